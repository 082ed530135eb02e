#include "stages/surface/curvature.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "scheduler/elementary.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {
constexpr double kRadPerDeg = std::numbers::pi / 180.0;

double cos_squared_deg(double latitude_deg) {
  const double c = cos_deg(latitude_deg);
  return c * c;
}
}  // namespace

CurvatureTerms curvature_terms(const PostGrid& grid) {
  CurvatureTerms terms;
  terms.metres_per_unit = -kEquatorialRadiusM / 2;
  terms.width_rad = (grid.longitude_deg.back() - grid.longitude_deg.front()) * kRadPerDeg;
  terms.height_rad = (grid.latitude_deg.back() - grid.latitude_deg.front()) * kRadPerDeg;
  const double middle_lon_deg = (grid.longitude_deg.front() + grid.longitude_deg.back()) / 2;
  const double middle_lat_deg = (grid.latitude_deg.front() + grid.latitude_deg.back()) / 2;
  for (const double longitude_deg : grid.longitude_deg) {
    const double dl = (longitude_deg - middle_lon_deg) * kRadPerDeg;
    terms.longitude_squared.push_back(dl * dl);
  }
  for (const double latitude_deg : grid.latitude_deg) {
    const double df = (latitude_deg - middle_lat_deg) * kRadPerDeg;
    terms.latitude_squared.push_back(df * df);
    terms.parallel_scale.push_back(cos_squared_deg(latitude_deg));
  }
  return terms;
}

std::int32_t side_stride_posts(const PostGrid& grid, Side side, double deepest_m) {
  std::int32_t stride = kTileIntervals;
  if (!grid.on_globe()) return stride;
  double widest_rad = 0;
  if (side == Side::kWest || side == Side::kEast) {
    // A mercator tile's rows are farther apart at its end towards the equator.
    for (std::size_t j = 1; j < grid.latitude_deg.size(); ++j) {
      const double apart_deg = grid.latitude_deg[j] - grid.latitude_deg[j - 1];
      widest_rad = std::max(widest_rad, apart_deg * kRadPerDeg);
    }
  } else {
    const double latitude_deg =
        side == Side::kSouth ? grid.latitude_deg.front() : grid.latitude_deg.back();
    const double width_deg = grid.longitude_deg.back() - grid.longitude_deg.front();
    widest_rad = width_deg * kRadPerDeg / kTileIntervals * std::sqrt(cos_squared_deg(latitude_deg));
  }
  const auto depth_m = [widest_rad](std::int32_t posts) {
    const double angle_rad = widest_rad * posts;
    return kEquatorialRadiusM / 8 * angle_rad * angle_rad;
  };
  while (stride > 1 && depth_m(stride) > deepest_m) stride /= 2;
  return stride;
}

double largest_sagitta_m(const PostGrid& grid) {
  if (!grid.on_globe()) return 0;
  const double width_rad = (grid.longitude_deg.back() - grid.longitude_deg.front()) * kRadPerDeg;
  const double height_rad = (grid.latitude_deg.back() - grid.latitude_deg.front()) * kRadPerDeg;
  const bool spans_equator = grid.latitude_deg.front() <= 0 && grid.latitude_deg.back() >= 0;
  const double scale = spans_equator ? 1.0
                                     : std::max(cos_squared_deg(grid.latitude_deg.front()),
                                                cos_squared_deg(grid.latitude_deg.back()));
  return kEquatorialRadiusM / 8 * (height_rad * height_rad + scale * width_rad * width_rad);
}

}  // namespace qmpipe
