// The height step of a zoom: all vertex heights of its tiles are multiples of it, so that a vertex
// on a common side decodes to the same height in both tiles (DESIGN 5.4).
#pragma once

#include "formats/result.h"

namespace qmpipe {

// A power of two, at most tolerance_m / 16 and at least largest_range_m / 32767, where
// largest_range_m is the height range of the zoom's tile with the largest one. Where the two bounds
// cross, the lower one wins as long as the step stays within the tolerance; else the format
// cannot hold the tolerance, which is the error.
Result<double> height_step_for(double tolerance_m, double largest_range_m);

// The multiple of the step nearest to the height (halves away from zero).
double snapped_height(double height_m, double step_m);

}  // namespace qmpipe
