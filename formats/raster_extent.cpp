#include "formats/raster_extent.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace qmpipe {
namespace {

constexpr int kStepsPerSide = 256;
constexpr int kStepsInside = 32;
// A gap in the longitudes narrower than this is the distance between two of our points.
constexpr double kWidestStepDeg = 12;

std::vector<PixelPoint> points_of(const RasterSize& size) {
  const double width = static_cast<double>(size.width);
  const double height = static_cast<double>(size.height);
  std::vector<PixelPoint> points;
  for (int k = 0; k <= kStepsPerSide; ++k) {
    const double part = static_cast<double>(k) / kStepsPerSide;
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
  const std::array<PixelPoint, 5> places = {{{0, 0},
                                             {width - 1, 0},
                                             {0, height - 1},
                                             {width - 1, height - 1},
                                             {std::floor(width / 2), std::floor(height / 2)}}};
  double smallest = std::numeric_limits<double>::infinity();
  for (const PixelPoint& place : places) {
    const std::optional<LonLat> at = to_globe(place);
    const std::optional<LonLat> east = to_globe({place.column + 1, place.row});
    const std::optional<LonLat> south = to_globe({place.column, place.row + 1});
    if (!at || !east || !south) continue;
    const auto steps = [&at](const LonLat& to) {
      return LonLat{std::abs(turned_into_half_circle(to.longitude_deg - at->longitude_deg)),
                    std::abs(to.latitude_deg - at->latitude_deg)};
    };
    const LonLat by_column = steps(*east);
    const LonLat by_row = steps(*south);
    for (const double extent : {std::max(by_column.longitude_deg, by_row.longitude_deg),
                                std::max(by_column.latitude_deg, by_row.latitude_deg)}) {
      if (extent > 0) smallest = std::min(smallest, extent);
    }
  }
  return std::isfinite(smallest) ? smallest : 0;
}

}  // namespace qmpipe
