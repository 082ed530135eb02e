// Simplifying one side alone, in one dimension: the coarsest line first, then always the worst
// post. What the colours of the wavefront improve on (there the owner's interior decides too), and
// the rule for the mercator root, whose west and east sides are one meridian.
#pragma once

#include <span>

#include "scheduler/border.h"

namespace qmpipe {

// The posts of a side that keep every other within the tolerance of the line through them, vertex
// heights snapped to the step; ends included, ties broken by position.
// REQUIRES: 257 positions, ascending, and 257 heights; tolerance_m > height_step_m / 2.
BorderMask simplify_border(std::span<const double> positions, std::span<const float> heights_m,
                           double tolerance_m, double height_step_m);

}  // namespace qmpipe
