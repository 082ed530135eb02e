// The parts of `qmpipe info`: each prints to stdout, complaints that end it to stderr, and returns
// the exit code.
#pragma once

#include <filesystem>
#include <optional>

#include "scheduler/tile_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

enum class ReportStyle { kText, kJson };

// 1 when layer.json is missing or no layer.json. Throws IoError.
int report_tile_set(const std::filesystem::path& path, ReportStyle style);

// A tile's own file, or a tile of the set at `path`. In a set whose rows count from the north (as
// layer.json's scheme says) the key does too, as the names of its files do.
struct TilePlace {
  std::filesystem::path path;
  std::optional<TileKey> key_in_set;
};

// 1 when it is no valid tile. Throws IoError.
int report_tile(const TilePlace& place, ReportStyle style);

// Axes of an exported mesh; the origin is the middle of the tile's rectangle on the ellipsoid.
enum class Frame { kEcef, kEnu };

struct MeshRequest {
  TilePlace place;
  std::filesystem::path mesh_path;
  Frame frame = Frame::kEnu;
  // Where absent: from the place, from the set's layer.json, else geodetic.
  std::optional<TileKey> key;
  std::optional<Projection> projection;
};

// 1 when the file is no valid tile or has no triangle. Throws UsageError when it cannot be told
// where the tile lies, IoError.
int write_tile_mesh(const MeshRequest& request);

}  // namespace qmpipe
