// One TIN that meets a target: a largest error or a number of triangles, with any method.
//
// Greedy insertion and edge collapse aim at either by themselves. The point-set methods know only how
// much they leave: the parameter that decides it (r_r, d_g, h_c or w_p) is searched by bisection.
#pragma once

#include <cstdint>
#include <optional>

#include "pipeline/recipe/method.h"
#include "pipeline/tin/dem.h"
#include "stages/finish/tile_error.h"

namespace qmpipe {

// At most one of the two; none: the parameters decide.
struct TinTarget {
  std::optional<double> tolerance_m = {};  // largest vertical error of a valid post on the TIN
  std::optional<std::int64_t> most_triangles = {};
};

struct TinMethod {
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
  ParameterValues values;
};

// With a tolerance, or without: at most a sixteenth of it, else of the 65536th part of the DEM's range;
// a power of two that is no finer than the precision of float32 at the DEM's heights.
double height_step_of(const Dem& dem, const std::optional<double>& tolerance_m);

// The smallest tolerance that float arithmetic can hold on this DEM.
double least_tolerance_m(const Dem& dem);

struct TargetedTin {
  Tin tin;                          // without the triangles over voids
  std::int64_t void_triangles = 0;  // those
  std::int64_t covered_voids = 0;   // void posts under the others
  ErrorSummary error;               // of the valid posts that the TIN covers
  ParameterValues values;           // those that led to it
  double height_step_m = 0;
  std::int32_t attempts = 1;
};

// For a tolerance the coarsest result that a bisection finds within it, for a number of triangles the
// finest one. Throws UsageError, which says what was reached and what to change, when the target cannot
// be met. REQUIRES: a value for each of the method's parameters.
TargetedTin simplify_to_target(const Dem& dem, const TinMethod& method, const TinTarget& target);

}  // namespace qmpipe
