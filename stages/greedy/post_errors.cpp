#include "stages/greedy/post_errors.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/surface/array_index.h"

namespace qmpipe {

PostErrors::HeightRange PostErrors::height_range(std::span<const float> heights_m, double step_m) {
  QMPIPE_CHECK(!heights_m.empty() && step_m > 0);
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  QMPIPE_CHECK(std::isfinite(*low) && std::isfinite(*high));
  const double middle_m = snapped_height(0.5 * (static_cast<double>(*low) + *high), step_m);
  return {.middle_m = middle_m,
          .reach_m = std::max(std::abs(*low - middle_m), std::abs(*high - middle_m)) + step_m};
}

PostErrors::PostErrors(const PostGrid& grid, std::span<const float> heights_m, double tolerance_m,
                       const HeightSteps& height_steps, Curvature curvature)
    : grid_(grid),
      units_per_column_(grid.u_exact.back() / (grid.width_posts - 1)),
      range_(height_range(heights_m, height_steps.inner_m)),
      heights_(grid.post_count() + WorstPost::kOverread) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  QMPIPE_CHECK(tolerance_m > height_steps.side_m / 2);
  for (std::size_t k = 0; k < heights_m.size(); ++k) {
    heights_[k] = static_cast<float>(static_cast<double>(heights_m[k]) - range_.middle_m);
  }
  // What float arithmetic may lose on the way comes off the tolerance, so that the bound is true: here,
  // and where the header's maximum, which may be a little above the highest vertex, becomes a float.
  const double farthest_m = grid.on_globe() ? std::abs(range_.middle_m) + 1.2 * range_.reach_m : 0;
  const double rounding = (6 * range_.reach_m + farthest_m / 2) *
                          static_cast<double>(std::numeric_limits<float>::epsilon());
  threshold_ = static_cast<float>(std::max(tolerance_m - rounding, tolerance_m / 2));

  curved_ = curvature == Curvature::kCounts && largest_sagitta_m(grid) > tolerance_m / 64;
  if (!curved_) return;
  curvature_ = curvature_terms(grid);
  curved_heights_.resize(heights_.size());
  for (std::int32_t j = 0; j < grid.height_posts; ++j) {
    for (std::int32_t i = 0; i < grid.width_posts; ++i) {
      const std::size_t k = at(grid.index(i, j));
      curved_heights_[k] = static_cast<float>(heights_[k] + curvature_.at(i, j));
    }
  }
}

PostErrors::TrianglePlanes PostErrors::planes_of(const Corners& corners) const {
  const IntPoint& a = corners[0].place;
  const IntPoint& b = corners[1].place;
  const IntPoint& c = corners[2].place;
  TrianglePlanes planes;
  planes.height =
      plane_through(a, b, c, corners[0].height_m, corners[1].height_m, corners[2].height_m);
  if (curved_) {
    const auto latitude = [&](const IntPoint& p) { return curvature_.latitude_squared_at(p.y); };
    const auto longitude = [&](const IntPoint& p) { return curvature_.longitude_squared_at(p.x); };
    planes.latitude_squared = plane_through(a, b, c, latitude(a), latitude(b), latitude(c));
    planes.longitude_squared = plane_through(a, b, c, longitude(a), longitude(b), longitude(c));
  }
  return planes;
}

PostErrors::PlaneRow PostErrors::height_row(const TrianglePlanes& planes, std::int32_t j) const {
  const double v = grid_.v_exact[at(j)];
  return {.at_first = planes.height.at(0, v), .step = planes.height.du * units_per_column_};
}

PostErrors::PlaneRow PostErrors::curved_row(const TrianglePlanes& planes, std::int32_t j) const {
  const double v = grid_.v_exact[at(j)];
  const double parallel = curvature_.parallel_scale[at(j)];
  const double start =
      planes.latitude_squared.at(0, v) + parallel * planes.longitude_squared.at(0, v);
  const double step = planes.latitude_squared.du + parallel * planes.longitude_squared.du;
  return {.at_first = planes.height.at(0, v) + curvature_.metres_per_unit * start,
          .step = (planes.height.du + curvature_.metres_per_unit * step) * units_per_column_};
}

Worst PostErrors::worst_post(const Corners& corners, std::int32_t j_first,
                             std::int32_t j_last) const {
  const TrianglePlanes planes = planes_of(corners);
  WorstPost worst;
  scan_triangle(grid_, corners[0].place, corners[1].place, corners[2].place, 1.0, j_first, j_last,
                [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
                  const std::int32_t first = grid_.index(i_first, j);
                  const std::int32_t n = i_last - i_first + 1;
                  const RowLine line = height_row(planes, j).from(i_first);
                  if (curved_) {
                    worst.look(heights_.data() + first, line, curved_heights_.data() + first,
                               curved_row(planes, j).from(i_first), first, n);
                  } else {
                    worst.look(heights_.data() + first, line, first, n);
                  }
                });
  return worst.result();
}

Worst PostErrors::worst_free_post(const Corners& corners, std::int32_t j_first, std::int32_t j_last,
                                  std::span<const std::uint8_t> blocked) const {
  const TrianglePlanes planes = planes_of(corners);
  Worst worst;
  scan_triangle(grid_, corners[0].place, corners[1].place, corners[2].place, 1.0, j_first, j_last,
                [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
                  const PlaneRow flat = height_row(planes, j);
                  const PlaneRow bent = curved_ ? curved_row(planes, j) : PlaneRow{};
                  for (std::int32_t i = i_first; i <= i_last; ++i) {
                    const std::int32_t post = grid_.index(i, j);
                    if (blocked[at(post)] != 0) continue;
                    double error = std::abs(flat.at_first + flat.step * i - heights_[at(post)]);
                    if (curved_) {
                      error = std::max(error, std::abs(bent.at_first + bent.step * i -
                                                       curved_heights_[at(post)]));
                    }
                    if (static_cast<float>(error) > worst.error)
                      worst = {static_cast<float>(error), post};
                  }
                });
  return worst;
}

}  // namespace qmpipe
