#include "stages/height_step.h"

#include <fmt/format.h>

#include <cmath>

#include "formats/quantized_mesh.h"

namespace qmpipe {

Result<double> height_step_for(double tolerance_m, double largest_range_m) {
  QMPIPE_CHECK(tolerance_m > 0 && largest_range_m >= 0);
  // Not by log2(), which rounds up just below a power of two.
  const double wanted = std::ldexp(1.0, std::ilogb(tolerance_m / 16));
  // Snapping can widen a range by one step.
  double step = wanted;
  while (largest_range_m + step > step * kQuantizedMax) step *= 2;
  if (step > tolerance_m) {
    return Error{fmt::format(
        "a tile with a height range of {:.1f} m cannot hold a tolerance of {:g} m, because the "
        "format has 32,768 heights a tile; use a tolerance of {:g} m or more",
        largest_range_m, tolerance_m, step)};
  }
  return step;
}

double snapped_height(double height_m, double step_m) {
  return std::round(height_m / step_m) * step_m;
}

}  // namespace qmpipe
