// Is a finished tile set right? Any quantized-mesh set, ours or another program's, held to the
// promises two to six of docs/decisions/0010-what-verify-promises.md.
//
// Guarantees: whatever the files hold, it ends with a report. The report depends on the set and the
// source alone, not on threads. Memory does not grow with the set beyond its keys: tiles are read
// row by row, and of a row only its northern borders are kept for the next one (HausdorffMode::
// kMeasured keeps a few numbers of each).
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/raster/height_options.h"
#include "formats/tile/tile_set.h"
#include "pipeline/common/finding.h"
#include "pipeline/common/hausdorff.h"
#include "pipeline/run/progress.h"
#include "stages/finish/tile_error.h"

namespace qmpipe::verify {

enum class HausdorffMode { kSkipped, kMeasured };

struct VerifyOptions {
  // Rasters in order of priority; without any, heights are not compared with a source.
  std::vector<std::string> sources = {};
  // Overrides the sources' CRS. DEFAULT: what the set was built with, else the sources' own.
  std::string source_crs = {};
  // What the sources' numbers mean. DEFAULT: what the set was built with, one by one.
  HeightOptions heights = {};
  // REQUIRES sources. DEFAULT: skipped.
  HausdorffMode hausdorff = HausdorffMode::kSkipped;
  std::int32_t threads = 1;
  // Findings kept of each kind; all are counted.
  std::int64_t most_per_kind = 20;
};

// A tile without a void post: the only ones whose distance from the source means something.
struct MeasuredTile {
  TileKey key;
  std::int64_t vertices = 0;
  std::int64_t triangles = 0;
  HausdorffDistances hausdorff;
};

struct ZoomReport {
  std::int32_t zoom = 0;
  std::int64_t tiles = 0;
  std::int64_t readable_tiles = 0;
  std::int64_t vertices = 0;
  std::int64_t triangles = 0;
  std::int64_t stored_bytes = 0;
  std::int64_t borders = 0;  // pairs of neighbours compared
  double largest_crack_m = 0;
  ErrorSummary error;  // its `worst` is of the tile worst_tile
  std::optional<TileKey> worst_tile;
  std::optional<double> tolerance_m;
  // Against the source's own posts, where the set has a recipe.
  ErrorSummary source_error;
  std::vector<MeasuredTile> measured;  // by HausdorffMode::kMeasured; by key

  double mean_vertices() const;
  double mean_triangles() const;
  HausdorffDistances mean_hausdorff() const;
};

struct VerifyReport {
  bool has_source = false;
  HausdorffMode hausdorff = HausdorffMode::kSkipped;
  std::vector<Finding> faults;    // the first of each kind, layer.json first, then by key
  std::vector<Finding> warnings;  // likewise
  std::array<std::int64_t, kFindingKinds> counts{};  // of each kind, all of them
  std::int64_t fault_count = 0;
  std::int64_t warning_count = 0;
  std::int64_t tiles = 0;
  double largest_crack_m = 0;
  std::vector<ZoomReport> zooms;  // those with tiles, ascending
};

// Throws UsageError for options that do not fit together, IoError when a source cannot be read,
// Interrupted when asked to stop.
VerifyReport verify_set(const TileSet& tile_set, const VerifyOptions& options, Progress& progress);

// For people: a table of the zooms, the warnings, the faults, and a line that sums up.
std::string text_of(const VerifyReport& report);
// For programs: one JSON object; keys and names of kinds are stable, lengths in metres.
std::string json_of(const VerifyReport& report);

}  // namespace qmpipe::verify
