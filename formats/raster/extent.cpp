#include "formats/raster/extent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>

#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr int kExtentStepsPerSide = 256;
constexpr int kStepsInside = 32;
// A gap in the longitudes narrower than this is the distance between two of our points.
constexpr double kWidestStepDeg = 12;
constexpr int kPlacesPerSide = 5;
// Some 600 m.
constexpr double kStepRad = 1e-4;

std::vector<PixelPoint> points_of(const RasterSize& size) {
  const double width = static_cast<double>(size.width);
  const double height = static_cast<double>(size.height);
  std::vector<PixelPoint> points;
  for (int k = 0; k <= kExtentStepsPerSide; ++k) {
    const double part = static_cast<double>(k) / kExtentStepsPerSide;
    points.push_back({.column = part * width, .row = 0});
    points.push_back({.column = part * width, .row = height});
    points.push_back({.column = 0, .row = part * height});
    points.push_back({.column = width, .row = part * height});
  }
  for (int r = 1; r < kStepsInside; ++r) {
    for (int c = 1; c < kStepsInside; ++c) {
      points.push_back({.column = width * c / kStepsInside, .row = height * r / kStepsInside});
    }
  }
  return points;
}

bool reaches(const RasterSize& size, const ToRaster& to_raster, double latitude_deg) {
  const std::optional<PixelPoint> at =
      to_raster({.longitude_deg = 0, .latitude_deg = latitude_deg});
  return at && at->column >= 0 && at->row >= 0 && at->column <= static_cast<double>(size.width) &&
         at->row <= static_cast<double>(size.height);
}

// The shortest range that holds all longitudes: the circle without its widest gap.
RectangleDeg range_of(std::vector<double> longitudes_deg) {
  std::sort(longitudes_deg.begin(), longitudes_deg.end());
  double widest = longitudes_deg.front() + 360 - longitudes_deg.back();
  RectangleDeg range{.west_deg = longitudes_deg.front(), .east_deg = longitudes_deg.back()};
  for (std::size_t k = 1; k < longitudes_deg.size(); ++k) {
    const double gap = longitudes_deg[k] - longitudes_deg[k - 1];
    if (gap <= widest) continue;
    widest = gap;
    range.west_deg = longitudes_deg[k];
    range.east_deg = longitudes_deg[k - 1] + 360;
  }
  if (widest < kWidestStepDeg) range = {.west_deg = -180, .east_deg = 180};
  return range;
}

double turned_into_half_circle(double degrees) { return std::remainder(degrees, 360.0); }

// On the sphere of the latitudes, not on the ellipsoid: so that a step along the meridian is as long
// as its degrees.
using Direction = std::array<double, 3>;

Direction direction_of(const LonLat& at) {
  const SinCos longitude = sin_cos_deg(at.longitude_deg);
  const SinCos latitude = sin_cos_deg(at.latitude_deg);
  return {latitude.cos * longitude.cos, latitude.cos * longitude.sin, latitude.sin};
}

double dot(const Direction& a, const Direction& b) {
  return a[0] * b[0] + a[1] * b[1] + a[2] * b[2];
}

// A pixel's two steps, in radians to the east and to the north of its middle. Differences of
// longitudes would be anything at all beside a pole.
struct PixelOnGlobe {
  double column_east = 0;
  double column_north = 0;
  double row_east = 0;
  double row_north = 0;
  double parallel = 1;  // the radius of the parallel

  double longer_side() const {
    return std::sqrt(std::max(column_east * column_east + column_north * column_north,
                              row_east * row_east + row_north * row_north));
  }
  // How far posts may be apart along the parallel and along the meridian, so that no more than a
  // pixel lies between two of them.
  double post_spacing_deg() const {
    const double area = std::abs(column_east * row_north - column_north * row_east);
    const double along_parallel =
        area / std::sqrt(column_north * column_north + row_north * row_north) / parallel;
    const double along_meridian = area / std::sqrt(column_east * column_east + row_east * row_east);
    return std::min(along_parallel, along_meridian) * (180 / std::numbers::pi);
  }
};

// Measured between two places `step` pixels on both sides, along the columns and along the rows.
std::optional<PixelOnGlobe> pixel_on_globe(const ToGlobe& to_globe, const PixelPoint& place,
                                           double step) {
  const std::optional<LonLat> at = to_globe(place);
  const std::optional<LonLat> west = to_globe({place.column - step, place.row});
  const std::optional<LonLat> east = to_globe({place.column + step, place.row});
  const std::optional<LonLat> above = to_globe({place.column, place.row - step});
  const std::optional<LonLat> below = to_globe({place.column, place.row + step});
  if (!at || !west || !east || !above || !below) return std::nullopt;
  const SinCos longitude = sin_cos_deg(at->longitude_deg);
  const SinCos latitude = sin_cos_deg(at->latitude_deg);
  const Direction to_east = {-longitude.sin, longitude.cos, 0};
  const Direction to_north = {-latitude.sin * longitude.cos, -latitude.sin * longitude.sin,
                              latitude.cos};
  const auto side = [step](const LonLat& from, const LonLat& to) {
    const Direction a = direction_of(from);
    const Direction b = direction_of(to);
    return Direction{(b[0] - a[0]) / (2 * step), (b[1] - a[1]) / (2 * step),
                     (b[2] - a[2]) / (2 * step)};
  };
  const Direction by_column = side(*west, *east);
  const Direction by_row = side(*above, *below);
  return PixelOnGlobe{.column_east = dot(by_column, to_east),
                      .column_north = dot(by_column, to_north),
                      .row_east = dot(by_row, to_east),
                      .row_north = dot(by_row, to_north),
                      .parallel = latitude.cos};
}

}  // namespace

RectangleDeg tidy_bounds(const RectangleDeg& bounds) {
  RectangleDeg tidy = bounds;
  tidy.south_deg = std::max(tidy.south_deg, -90.0);
  tidy.north_deg = std::min(tidy.north_deg, 90.0);
  if (tidy.east_deg - tidy.west_deg >= 360 - 1e-9) {
    tidy.west_deg = -180;
    tidy.east_deg = 180;
    return tidy;
  }
  const double turns = std::floor((tidy.west_deg + 180) / 360);
  tidy.west_deg -= 360 * turns;
  tidy.east_deg -= 360 * turns;
  return tidy;
}

std::optional<RectangleDeg> bounds_on_globe(const RasterSize& size, const ToGlobe& to_globe,
                                            const ToRaster& to_raster) {
  std::vector<double> longitudes_deg;
  RectangleDeg bounds{.south_deg = 90, .north_deg = -90};
  bool is_partly_off = false;
  for (const PixelPoint& point : points_of(size)) {
    const std::optional<LonLat> at = to_globe(point);
    if (!at || std::abs(at->latitude_deg) > 90 + 1e-9) {
      is_partly_off = true;
      continue;
    }
    longitudes_deg.push_back(turned_into_half_circle(at->longitude_deg));
    bounds.south_deg = std::min(bounds.south_deg, at->latitude_deg);
    bounds.north_deg = std::max(bounds.north_deg, at->latitude_deg);
  }
  if (longitudes_deg.empty()) return std::nullopt;
  const RectangleDeg range = range_of(std::move(longitudes_deg));
  bounds.west_deg = range.west_deg;
  bounds.east_deg = range.east_deg;
  if (is_partly_off) {
    // The edge of the globe runs between our points: up to one step of the inner grid is missing.
    const double step = 2.0 / kStepsInside;
    const double more_lon = step * (bounds.east_deg - bounds.west_deg);
    const double more_lat = step * (bounds.north_deg - bounds.south_deg);
    bounds = {.west_deg = bounds.west_deg - more_lon,
              .south_deg = bounds.south_deg - more_lat,
              .east_deg = bounds.east_deg + more_lon,
              .north_deg = bounds.north_deg + more_lat};
  }
  for (const double pole : {-90.0, 90.0}) {
    if (!reaches(size, to_raster, pole)) continue;
    bounds.west_deg = -180;
    bounds.east_deg = 180;
    (pole < 0 ? bounds.south_deg : bounds.north_deg) = pole;
  }
  return tidy_bounds(bounds);
}

double smallest_pixel_deg(const RasterSize& size, const ToGlobe& to_globe) {
  const double width = static_cast<double>(size.width);
  const double height = static_cast<double>(size.height);
  double smallest = std::numeric_limits<double>::infinity();
  for (int r = 0; r < kPlacesPerSide; ++r) {
    for (int c = 0; c < kPlacesPerSide; ++c) {
      const auto middle = [](double length, int k) {
        return std::floor((length - 1) * k / (kPlacesPerSide - 1)) + 0.5;
      };
      const PixelPoint place{.column = middle(width, c), .row = middle(height, r)};
      const std::optional<PixelOnGlobe> rough = pixel_on_globe(to_globe, place, 0.5);
      if (!rough || !(rough->longer_side() > 0)) continue;
      // Far enough for the last digits of a fine pixel, near enough for the arcs of a coarse one.
      const double step = std::min(kStepRad / rough->longer_side(), std::min(width, height) / 2);
      const PixelPoint inside{.column = std::clamp(place.column, step, width - step),
                              .row = std::clamp(place.row, step, height - step)};
      const std::optional<PixelOnGlobe> pixel = pixel_on_globe(to_globe, inside, step);
      if (!pixel) continue;
      const double extent_deg = pixel->post_spacing_deg();
      if (extent_deg > 0) smallest = std::min(smallest, extent_deg);
    }
  }
  return std::isfinite(smallest) ? smallest : 0;
}

}  // namespace qmpipe
