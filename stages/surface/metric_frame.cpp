#include "stages/surface/metric_frame.h"

#include <cmath>
#include <numbers>

#include "scheduler/elementary.h"

namespace qmpipe {

MetricFrame::MetricFrame(const PostGrid& grid) : grid_(grid) {}

Vec3 MetricFrame::position(std::int32_t post, double height_m) const {
  const auto i = static_cast<std::size_t>(grid_.column(post));
  const auto j = static_cast<std::size_t>(grid_.row(post));
  if (grid_.on_globe()) return to_ecef({grid_.longitude_deg[i], grid_.latitude_deg[j], height_m});
  return {grid_.u_exact[i] * grid_.metres_per_u, grid_.v_exact[j] * grid_.metres_per_v, height_m};
}

Vec3 MetricFrame::at_height(const Vec3& position, double height_m) const {
  if (!grid_.on_globe()) return {position[0], position[1], height_m};
  return moved_to_height(position, height_m);
}

MetricFrame::Place MetricFrame::place_of(const Vec3& position) const {
  if (!grid_.on_globe()) {
    return {.u = position[0] / grid_.metres_per_u, .v = position[1] / grid_.metres_per_v};
  }
  const GeoPoint point = to_geodetic(position);
  const double west_deg = grid_.longitude_deg.front();
  const double width_deg = grid_.longitude_deg.back() - west_deg;
  const double south_deg = grid_.latitude_deg.front();
  const double height_deg = grid_.latitude_deg.back() - south_deg;
  const double from_middle_deg =
      std::remainder(point.longitude_deg - (west_deg + width_deg / 2), 360.0);
  return {.u = (from_middle_deg / width_deg + 0.5) * grid_.u_exact.back(),
          .v = (point.latitude_deg - south_deg) / height_deg * grid_.v_exact.back()};
}

FlatScale flat_scale(const PostGrid& grid) {
  if (!grid.on_globe()) {
    return {.metres_per_u = grid.metres_per_u, .metres_per_v = grid.metres_per_v};
  }
  constexpr double kMetresPerDegree = kEquatorialRadiusM * std::numbers::pi / 180;
  const double width_deg = grid.longitude_deg.back() - grid.longitude_deg.front();
  const double height_deg = grid.latitude_deg.back() - grid.latitude_deg.front();
  const double middle_deg = grid.latitude_deg.front() + height_deg / 2;
  return {.metres_per_u = kMetresPerDegree * width_deg / grid.u_max() * cos_deg(middle_deg),
          .metres_per_v = kMetresPerDegree * height_deg / grid.v_max()};
}

}  // namespace qmpipe
