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

// 1 when the file is no valid tile. Throws IoError.
int report_tile(const std::filesystem::path& path, ReportStyle style);

// Axes of an exported mesh; the origin is the middle of the tile's rectangle on the ellipsoid.
enum class Frame { kEcef, kEnu };

struct MeshRequest {
  std::filesystem::path tile_path;
  std::filesystem::path mesh_path;
  Frame frame = Frame::kEnu;
  // Where absent: from the path, from the set's layer.json, else geodetic.
  std::optional<TileKey> key;
  std::optional<Projection> projection;
};

// 1 when the file is no valid tile or has no triangle. Throws UsageError when it cannot be told
// where the tile lies, IoError.
int write_tile_mesh(const MeshRequest& request);

}  // namespace qmpipe
