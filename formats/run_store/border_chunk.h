// Borders to compressed chunks and back, in the bytes that HDF5's filters would make of an array of
// records: its byte shuffle (filter 2), then one zstd frame (registered filter 32015).
//
// A record has 46 bytes, little-endian: zoom, x, y (int32 each), side (uint8, 0 west, 1 south,
// 2 east, 3 north), mask (33 bytes: position k of the side is bit k % 8 of byte k / 8).
// Different threads may use these functions at once.
#pragma once

#include <compare>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "scheduler/border.h"
#include "scheduler/tile_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// A border's name. The order is that of the files: zoom, y, x, side.
struct BorderKey {
  TileKey owner;
  Side side = Side::kWest;
  friend constexpr auto operator<=>(const BorderKey&, const BorderKey&) = default;
};

// Different for every border up to kMaxZoom: the side lies in bits of y that no zoom reaches.
constexpr std::uint64_t packed(const BorderKey& key) {
  return packed(key.owner) | static_cast<std::uint64_t>(index_of(key.side)) << 56U;
}
// "zoom/x/y north"
std::string to_string(const BorderKey& key);

struct Border {
  BorderKey key;
  BorderMask mask;
  friend bool operator==(const Border&, const Border&) = default;
};

inline constexpr std::size_t kMaskBytes = 33;
inline constexpr std::size_t kBorderBytes = 46;
// No chunk has more records.
inline constexpr std::size_t kMaxChunkBorders = 512;

// A chunk of `records` records: the borders, then zeros. `level` is zstd's. REQUIRES: 1 <=
// borders.size() <= records <= kMaxChunkBorders.
std::vector<std::uint8_t> pack_borders(std::span<const Border> borders, std::size_t records,
                                       int level);

// The first `count` borders of a chunk of `records` records. Refuses anything but a whole chunk
// with sides and masks that exist, in ascending order; owners may lie outside every scheme.
// REQUIRES: as for pack_borders().
Result<std::vector<Border>> unpack_borders(std::span<const std::uint8_t> chunk, std::size_t count,
                                           std::size_t records);

// No chunk is larger.
std::size_t largest_border_chunk_bytes();

}  // namespace qmpipe
