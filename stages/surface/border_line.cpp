#include "stages/surface/border_line.h"

#include <cmath>
#include <utility>
#include <vector>

#include "scheduler/check.h"
#include "stages/posts/height_step.h"

namespace qmpipe {

BorderMask simplify_border(std::span<const double> positions, std::span<const float> heights_m,
                           double tolerance_m, double height_step_m) {
  QMPIPE_CHECK(positions.size() == kTilePosts && heights_m.size() == kTilePosts);
  const auto place = [&](std::int32_t k) { return positions[static_cast<std::size_t>(k)]; };
  const auto height = [&](std::int32_t k) {
    return static_cast<double>(heights_m[static_cast<std::size_t>(k)]);
  };
  BorderMask mask;
  mask.set(0);
  mask.set(kTileIntervals);
  // Segments are independent of each other, so their order does not change the result.
  std::vector<std::pair<std::int32_t, std::int32_t>> segments = {{0, kTileIntervals}};
  while (!segments.empty()) {
    const auto [from, to] = segments.back();
    segments.pop_back();
    const double from_m = snapped_height(height(from), height_step_m);
    const double to_m = snapped_height(height(to), height_step_m);
    const double slope = (to_m - from_m) / (place(to) - place(from));
    double largest_m = tolerance_m;
    std::int32_t worst = -1;
    for (std::int32_t k = from + 1; k < to; ++k) {
      const double error_m = std::abs(from_m + slope * (place(k) - place(from)) - height(k));
      if (error_m > largest_m) {
        largest_m = error_m;
        worst = k;
      }
    }
    if (worst < 0) continue;
    mask.set(worst);
    segments.emplace_back(from, worst);
    segments.emplace_back(worst, to);
  }
  return mask;
}

}  // namespace qmpipe
