// The height steps of a zoom and of its tiles: all vertex heights are multiples of them, so that a
// vertex on a common side decodes to the same height in both tiles (docs/decisions/0003-height-steps.md).
//
// Vertices on sides take the zoom's step. Those inside a tile may take a part of it, which the tile
// chooses by its own range, so that a zoom with one mountain does not coarsen its plains.
#pragma once

#include <optional>

#include "formats/bytes/result.h"

namespace qmpipe {

// Heights from low_m to high_m.
struct HeightSpan {
  double low_m = 0;
  double high_m = 0;

  double range_m() const { return high_m - low_m; }
  // How far from 0 it reaches.
  double reach_m() const { return -low_m > high_m ? -low_m : high_m; }
  void include(const HeightSpan& other);
  friend bool operator==(const HeightSpan&, const HeightSpan&) = default;
};

// The other's too; none: it alone.
void include(std::optional<HeightSpan>& all, const HeightSpan& other);

// A tile's steps. Guarantee: side_m is inner_m times parts.
struct HeightSteps {
  double side_m = 0;
  double inner_m = 0;
  int parts = 1;

  HeightSteps() = default;
  // One step for all vertices.
  HeightSteps(double step_m)  // NOLINT(google-explicit-constructor)
      : side_m(step_m), inner_m(step_m) {}
  HeightSteps(double of_sides_m, int side_parts)
      : side_m(of_sides_m), inner_m(of_sides_m / side_parts), parts(side_parts) {}
  friend bool operator==(const HeightSteps&, const HeightSteps&) = default;
};

// The step of a zoom's sides, where largest_range_m is the range of the tile with the largest one and
// reach_m the farthest from 0 of them all. It is a sixteenth of the tolerance, or, where a tile's range
// would fill more than an eighth of the format's 32,768 heights with it, as much more as it takes to
// fill no more, up to half of the tolerance: so the header's range can follow the tile's closely. It has
// as few significant bits (at most 8) as its multiples up to reach_m need to be exact in float32.
// The error: the format cannot hold the tolerance, and the message names the least that it can.
Result<double> height_step_for(double tolerance_m, double largest_range_m, double reach_m);

// The least tolerance that height_step_for() accepts, rounded up to three digits.
double least_tolerance_m(double largest_range_m, double reach_m);

// A tile's own steps: inner vertices in steps of about a sixteenth of the tolerance, in such parts of the
// side's that the header's range is at most 15 % wider than the tile's where 32,768 heights allow it.
// REQUIRES: side_step_m of height_step_for() with at least this range.
HeightSteps tile_steps(double side_step_m, double tolerance_m, double range_m);

// The multiple of the step nearest to the height (halves away from zero).
double snapped_height(double height_m, double step_m);

}  // namespace qmpipe
