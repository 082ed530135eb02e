#include "formats/raster/grid.h"

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "formats/raster/extent.h"
#include "formats/raster/placement.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Files store the pixel size with a dozen digits at best, which adds up over the columns.
constexpr double kWrapTolerancePixels = 0.01;
// The same place after a transformation: a micrometre.
constexpr double kSamePlaceDeg = 1e-11;
// The last bits of what PROJ answers depend on the processor. A thousandth of a pixel is some
// million times as much, so that but for one place in a million they are gone, and it is small beside
// the hundredth to which places between anchor posts are exact.
constexpr double kSnapsPerPixel = 1024;
// Where one number ends and the next begins: not at a half, on which posts of a grid that is made
// for the tiling would lie one and all, each to be decided by its last bit.
constexpr double kSnapFrom = 0.4871;
constexpr double kSnapsPerDegree = 1e9;
// Some centimetres of the equator.
constexpr double kSameTurn = 1e-9;
// A micrometre, as kSamePlaceDeg: an edge at a whole degree is not the next number's for its last
// bit.
constexpr double kSameSnap = 0.01;

std::vector<MapPoint> sample_points(const GridInfo& info) {
  constexpr int kSteps = 8;
  std::vector<MapPoint> points;
  for (int r = 0; r <= kSteps; ++r) {
    for (int c = 0; c <= kSteps; ++c) {
      points.push_back(info.plane.map_of({static_cast<double>(info.width) * c / kSteps,
                                          static_cast<double>(info.height) * r / kSteps}));
    }
  }
  return points;
}

// Then no transformation need be called at all.
bool leaves_degrees_alone(const CrsTransform& transform, std::span<const MapPoint> points) {
  return std::all_of(points.begin(), points.end(), [&transform](const MapPoint& point) {
    if (std::abs(point.y) > 90) return true;
    const LonLat at{.longitude_deg = std::remainder(point.x, 360.0), .latitude_deg = point.y};
    const std::optional<MapPoint> same = transform.forward(at);
    return same && std::abs(same->y - at.latitude_deg) <= kSamePlaceDeg &&
           std::abs(std::remainder(same->x - at.longitude_deg, 360.0)) <= kSamePlaceDeg;
  });
}

// False where x of a longitude is another on another parallel by more than a datum makes: cheap
// beside turn_along_x(). Operations that do not reach the whole globe say little.
bool may_go_round(const CrsTransform& transform) {
  constexpr double kSamePart = 1e-3;
  for (const double longitude_deg : {-100.3, 20.7, 140.1}) {
    const auto at = [&](double latitude_deg) {
      return transform.forward({.longitude_deg = longitude_deg, .latitude_deg = latitude_deg});
    };
    const std::optional<MapPoint> middle = at(0);
    for (const std::optional<MapPoint>& there : {at(-50), at(50)}) {
      if (!middle || !there) continue;
      const double size = std::abs(middle->x) + std::abs(there->y);
      if (!(std::abs(there->x - middle->x) <= kSamePart * size)) return false;
    }
  }
  return true;
}

PixelPoint snapped(const PixelPoint& p) {
  return {.column = std::floor(p.column * kSnapsPerPixel + kSnapFrom) / kSnapsPerPixel,
          .row = std::floor(p.row * kSnapsPerPixel + kSnapFrom) / kSnapsPerPixel};
}

// Outwards; whole degrees stay what they are.
RectangleDeg widened(const RectangleDeg& bounds) {
  const auto down = [](double deg) {
    return std::floor(deg * kSnapsPerDegree + kSameSnap) / kSnapsPerDegree;
  };
  const auto up = [&down](double deg) { return -down(-deg); };
  return {.west_deg = down(bounds.west_deg),
          .south_deg = down(bounds.south_deg),
          .east_deg = up(bounds.east_deg),
          .north_deg = up(bounds.north_deg)};
}

}  // namespace

PixelPoint PixelPlane::pixel_of(const MapPoint& m) const {
  const double x = m.x - x0;
  const double y = m.y - y0;
  // Divided one by one, so that a column depends on x alone, to the last bit.
  if (is_axis_aligned()) return {.column = x / x_per_column, .row = y / y_per_row};
  return {.column = (y_per_row * x - x_per_row * y) / determinant(),
          .row = (x_per_column * y - y_per_column * x) / determinant()};
}

double PixelPlane::smaller_extent() const {
  if (is_axis_aligned()) return std::min(std::abs(x_per_column), std::abs(y_per_row));
  const auto length = [](double a, double b) { return std::sqrt(a * a + b * b); };
  const double area = std::abs(determinant());
  return std::min(area / length(y_per_column, y_per_row), area / length(x_per_column, x_per_row));
}

double columns_round_globe(const GridInfo& info) {
  QMPIPE_CHECK(info.placement != nullptr);
  if (!info.plane.is_axis_aligned()) return 0;
  return info.placement->turn / std::abs(info.plane.x_per_column);
}

std::int64_t columns_of_a_turn(const GridInfo& info) {
  const double pixels = columns_round_globe(info);
  // A whole number of more pixels than a double counts by hundredths is nobody's.
  if (!(pixels > 0.5) || pixels > 1e12) return 0;
  const double whole = std::round(pixels);
  return std::abs(pixels - whole) <= kWrapTolerancePixels ? static_cast<std::int64_t>(whole) : 0;
}

RasterGrid::RasterGrid(GridInfo info, std::unique_ptr<CrsTransform> transform)
    : info_(std::move(info)), transform_(std::move(transform)) {
  const RasterPlacement& placement = *info_.placement;
  if (placement.is_identity) {
    // It holds a connection to PROJ's database.
    transform_.reset();
  } else if (!transform_) {
    transform_ = CrsTransform::make(placement.crs.text, sample_points(info_));
    // It was there when the grid was placed.
    QMPIPE_CHECK(transform_ != nullptr);
  }
  turn_ = placement.turn;
  middle_x_ =
      info_.plane
          .map_of({static_cast<double>(info_.width) / 2, static_cast<double>(info_.height) / 2})
          .x;
}

RasterGrid::RasterGrid(const GridInfo& info) : RasterGrid(info, nullptr) {}
RasterGrid::~RasterGrid() = default;
RasterGrid::RasterGrid(RasterGrid&&) noexcept = default;
RasterGrid& RasterGrid::operator=(RasterGrid&&) noexcept = default;

std::optional<RasterGrid> RasterGrid::place(const GridInfo& shape, const RasterCrs& crs) {
  const std::vector<MapPoint> points = sample_points(shape);
  std::unique_ptr<CrsTransform> transform = CrsTransform::make(crs.text, points);
  if (!transform) return std::nullopt;
  RasterPlacement placement{
      .crs = crs, .transformation = transform->name(), .is_ballpark = transform->is_ballpark()};
  placement.is_identity = crs.is_geographic && leaves_degrees_alone(*transform, points);
  if (crs.is_geographic) {
    placement.turn = crs.turn;
  } else if (may_go_round(*transform)) {
    placement.turn = CrsTransform::turn_along_x(crs.text);
  }
  GridInfo info = shape;
  info.is_separable = placement.is_identity && info.plane.is_axis_aligned();
  info.placement = std::make_shared<const RasterPlacement>(std::move(placement));
  RasterGrid grid(info, std::move(transform));
  grid.measure();
  return grid;
}

std::optional<PixelPoint> RasterGrid::pixel_at(double longitude_deg, double latitude_deg) const {
  MapPoint map{.x = longitude_deg, .y = latitude_deg};
  if (transform_) {
    const std::optional<MapPoint> projected =
        transform_->forward({.longitude_deg = longitude_deg, .latitude_deg = latitude_deg});
    if (!projected) return std::nullopt;
    map = *projected;
  }
  if (turn_ > 0) {
    // Where half a turn is reached must not be decided by PROJ's last bit.
    const double slack = transform_ ? kSameTurn : 0;
    map.x -= turn_ * std::floor((map.x - middle_x_ + turn_ / 2) / turn_ + slack);
  }
  const PixelPoint pixel = info_.plane.pixel_of(map);
  return transform_ ? snapped(pixel) : pixel;
}

std::optional<LonLat> RasterGrid::globe_at(const PixelPoint& point) const {
  const MapPoint map = info_.plane.map_of(point);
  if (!transform_) return LonLat{.longitude_deg = map.x, .latitude_deg = map.y};
  return transform_->inverse(map);
}

void RasterGrid::measure() {
  const RasterSize size{.width = info_.width, .height = info_.height};
  info_.wraps_columns = columns_of_a_turn(info_) == info_.width;
  if (info_.is_separable) {
    const MapPoint first = info_.plane.map_of({0, 0});
    const MapPoint last =
        info_.plane.map_of({static_cast<double>(info_.width), static_cast<double>(info_.height)});
    info_.bounds_deg = tidy_bounds({.west_deg = std::min(first.x, last.x),
                                    .south_deg = std::min(first.y, last.y),
                                    .east_deg = std::max(first.x, last.x),
                                    .north_deg = std::max(first.y, last.y)});
    info_.pixel_deg = info_.plane.smaller_extent();
    return;
  }
  const ToGlobe to_globe = [this](const PixelPoint& p) { return globe_at(p); };
  const std::optional<RectangleDeg> bounds = bounds_on_globe(
      size, to_globe,
      [this](const LonLat& p) { return pixel_at(p.longitude_deg, p.latitude_deg); });
  if (bounds) info_.bounds_deg = widened(*bounds);
  // Degrees of another datum are as long; at a pole they can be measured no better.
  info_.pixel_deg = info_.placement->crs.is_geographic
                        ? info_.plane.smaller_extent() * info_.plane.unit
                        : smallest_pixel_deg(size, to_globe);
}

}  // namespace qmpipe
