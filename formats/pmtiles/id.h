// The numbers of tiles in a PMTiles archive: one Hilbert curve for each zoom, one after the other.
//
// Rows count from the north here. formats/pmtiles/pmtiles.h says how our keys become positions of an archive.
// Source: PMTiles specification, version 3, "Entries"; the curve by its recursive definition.
#pragma once

#include <cstdint>
#include <optional>

#include "scheduler/tile_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// The deepest zoom whose ids are told from those of other zooms here.
inline constexpr std::int32_t kDeepestArchiveZoom = 30;

// x from the west, y from the north, both < 2^zoom.
struct ArchivePosition {
  std::int32_t zoom = 0;
  std::uint32_t x = 0;
  std::uint32_t y = 0;
  friend bool operator==(const ArchivePosition&, const ArchivePosition&) = default;
};

// The number of tiles of all zooms below `zoom`. REQUIRES: 0 <= zoom <= 31.
std::uint64_t first_archive_id(std::int32_t zoom);

// REQUIRES: a position on the grid, zoom <= kDeepestArchiveZoom.
std::uint64_t archive_id(const ArchivePosition& position);

// None beyond kDeepestArchiveZoom.
std::optional<ArchivePosition> archive_position(std::uint64_t id);

// The tile that stands there; none when no tile of the scheme does.
std::optional<TileKey> key_of_archive_id(std::uint64_t id, Projection projection);

}  // namespace qmpipe
