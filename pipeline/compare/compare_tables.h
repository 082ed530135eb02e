// A comparison as numbers: the paper's tables as CSV, and all of it as JSON.
#pragma once

#include <string>
#include <vector>

#include "pipeline/compare/compare.h"

namespace qmpipe {

// One row of the paper's Table 4: a method in a zoom.
struct ComparedZoom {
  std::int32_t zoom = 0;
  std::int64_t tiles = 0;
  std::int64_t full_tiles = 0;  // without voids: what the means are taken over
  double mean_vertices = 0;
  double mean_triangles = 0;
  double mean_bytes = 0;       // of all tiles, as stored
  double mean_tile_ms = 0;     // of one core, in the simplification alone; of all tiles
  double largest_error_m = 0;  // vertical, at valid posts of all tiles
  double rms_error_m = 0;
  double hausdorff_m = 0;                  // mean, to the other's surface
  double points_hausdorff_m = 0;           // mean, between the sets of points
  std::vector<double> sorted_hausdorff_m;  // of each full tile, ascending: Figure 8
};

// Zooms as in the report of the build.
std::vector<ComparedZoom> zooms_of(const ComparedMethod& method);

// Largest, RMS error and mean distance in metres, times in the units that the heads name.
std::string single_tile_csv(const Comparison& comparison);  // Table 2
std::string zooms_csv(const Comparison& comparison);        // Table 4
std::string run_times_csv(const Comparison& comparison);    // Table 5
std::string distances_csv(const Comparison& comparison);    // Figure 8
std::string comparison_json(const Comparison& comparison);

}  // namespace qmpipe
