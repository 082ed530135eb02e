#include "stages/posts/height_step.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe {
namespace {

constexpr int kFloatBits = 24;
constexpr int kMostStepBits = 8;
// A range of so many steps leaves a whole multiple of at least eight units for each.
constexpr double kRoomyRange = 4090;
// Snapping both ends can widen a range by a step.
constexpr double kLargestRange = kQuantizedMax - 1;

// Nothing is gained from steps below the distance of two float32 heights.
double float_spacing_m(double reach_m) {
  return std::ldexp(1.0, (reach_m > 0 ? std::ilogb(reach_m) : -kFloatBits) + 1 - kFloatBits);
}

// The step's significant bits, so that its multiples up to reach_m fit a float32's.
int step_bits(double step_m, double reach_m) {
  const double multiples = std::ceil(reach_m / step_m) + 1;
  return std::clamp(kFloatBits - (std::ilogb(multiples) + 1), 1, kMostStepBits);
}

// The nearest number of few significant bits that is not above (below) this one.
double rounded_step(double step_m, double reach_m, bool upwards) {
  const double bit = std::ldexp(1.0, std::ilogb(step_m) + 1 - step_bits(step_m, reach_m));
  return (upwards ? std::ceil(step_m / bit) : std::floor(step_m / bit)) * bit;
}

double finest_step_m(double largest_range_m, double reach_m) {
  const double step_m = std::max(largest_range_m / kLargestRange, float_spacing_m(reach_m));
  return rounded_step(step_m, reach_m, true);
}

}  // namespace

void HeightSpan::include(const HeightSpan& other) {
  low_m = std::min(low_m, other.low_m);
  high_m = std::max(high_m, other.high_m);
}

void include(std::optional<HeightSpan>& all, const HeightSpan& other) {
  if (all) {
    all->include(other);
  } else {
    all = other;
  }
}

double least_tolerance_m(double largest_range_m, double reach_m) {
  const double least_m = finest_step_m(largest_range_m, reach_m);
  double digit = 1e-7;
  while (least_m / digit >= 1000) digit *= 10;
  // However the digits are rounded when they are printed and read again.
  return std::ceil(least_m * (1 + 1e-9) / digit) * digit;
}

Result<double> height_step_for(double tolerance_m, double largest_range_m, double reach_m) {
  QMPIPE_CHECK(tolerance_m > 0 && largest_range_m >= 0 && reach_m >= 0);
  const double finest_m = finest_step_m(largest_range_m, reach_m);
  if (finest_m > tolerance_m) {
    return Error{fmt::format(
        "a tile with a height range of {:.1f} m cannot hold a tolerance of {:g} m, because the "
        "format has 32,768 heights a tile; use a tolerance of {:g} m or more",
        largest_range_m, tolerance_m, least_tolerance_m(largest_range_m, reach_m))};
  }
  const double fine_m = rounded_step(tolerance_m / 16, reach_m, false);
  const double roomy_m = rounded_step(
      std::max(largest_range_m / kRoomyRange, float_spacing_m(reach_m)), reach_m, true);
  const double coarsest_m = std::max(rounded_step(tolerance_m / 2, reach_m, false), finest_m);
  return std::clamp(std::max(fine_m, roomy_m), finest_m, coarsest_m);
}

HeightSteps tile_steps(double side_step_m, double tolerance_m, double range_m) {
  const double wanted = std::ceil(16 * side_step_m / tolerance_m);
  if (wanted <= 1) return {side_step_m, 1};
  // So many units there may be to a step of the sides: snapping moves both ends, and the header's
  // minimum is on a step of the sides below the lowest vertex.
  const int most = static_cast<int>(kQuantizedMax / (std::ceil(range_m / side_step_m) + 2));
  const int least = std::min(static_cast<int>(wanted), most);
  for (int units = most / std::max(least, 1); units > 1; --units) {
    const int parts = most / units;
    if (units * parts * 100 >= most * 97) return {side_step_m, parts};
  }
  return {side_step_m, std::max(most, 1)};
}

double snapped_height(double height_m, double step_m) {
  return std::round(height_m / step_m) * step_m;
}

}  // namespace qmpipe
