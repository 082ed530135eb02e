// `qmpipe detail build`: points or a DEM to a detail-increment model (Ai et al. 2019).
//
// Guarantees: the same input and options give the same model, bit for bit, on any number of threads.
#pragma once

#include <cstdint>
#include <string>

#include "formats/detail_model/data.h"
#include "formats/heights/tally.h"
#include "formats/points/point_cloud.h"
#include "pipeline/run/progress.h"
#include "stages/detail_model/base.h"

namespace qmpipe {

struct DetailBuildOptions {
  std::string input;
  // How points are read; the CRS counts for DEMs too.
  PointReadOptions points = {};
  // Of a DEM.
  HeightOptions heights = {};
  HeightGuard guard = HeightGuard::kStop;
  // Part of the triangles that the coarsest level keeps. DEFAULT: 0.2, as in the paper.
  double keep_share = 0.2;
  // DEFAULT: 4, as in the paper.
  std::int32_t blocks = 4;
  // Levels that one increment is merged over. DEFAULT: 100.
  std::uint32_t interval = 100;
  // Heights of a DEM are rounded to multiples of it. DEFAULT: 0, that is 1 m where all are whole metres,
  // else 1 cm.
  double height_step_m = 0;
  std::int32_t threads = 1;
};

struct DetailBuildReport {
  std::int64_t points = 0;
  // Voids and posts without a triangle; of a cloud what PointCounts counts.
  std::int64_t left_out = 0;
  std::string left_out_text;  // why, of a cloud
  std::int64_t finest_triangles = 0;
  std::int64_t coarsest_triangles = 0;
  std::int64_t seam_triangles = 0;
  std::int64_t collapses = 0;
  double read_s = 0;
  double triangulate_s = 0;
  double simplify_s = 0;
};

struct DetailBuilt {
  DetailModel model;
  DetailBuildReport report;
};

// Points (is_point_file()) or else a raster. Notes what had to be assumed. Throws UsageError for options
// that make no sense, IoError when the input cannot be read or has no triangle.
DetailBuilt build_detail(const DetailBuildOptions& options, Progress& progress);

// Simplifies each block of a base, in parallel. `report` gets the counts of triangles and collapses.
DetailModel simplify_base(DetailBase base, const DetailFrame& frame,
                          const DetailBuildOptions& options, Progress& progress,
                          DetailBuildReport& report);

}  // namespace qmpipe
