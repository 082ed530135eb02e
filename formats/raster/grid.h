// A grid of pixels and where it lies on the globe, whatever files its heights are in.
//
// Guarantees: pixel_at() is a pure function of the point and the grid, so two tiles that ask for the
// same post get the same place. A RasterGrid is used by one thread at a time (PROJ's objects are);
// open one for each thread.
//
// Pixel coordinates: (0, 0) is the outer corner of the first pixel, pixel (c, r) covers
// [c, c+1) x [r, r+1), and its value stands at its centre (c + 0.5, r + 0.5).
#pragma once

#include <cstdint>
#include <memory>
#include <optional>

#include "formats/crs/transform.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

struct PixelPoint {
  double column = 0;
  double row = 0;
};

struct PixelWindow {
  std::int64_t column0 = 0;
  std::int64_t row0 = 0;
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::size_t size() const { return static_cast<std::size_t>(width * height); }
};

// Where pixels lie in the raster's own CRS, as its geotransform says: a pixel's outer corner (c, r)
// is at x = x0 + x_per_column c + x_per_row r, and y likewise.
struct PixelPlane {
  double x0 = 0;
  double x_per_column = 1;
  double x_per_row = 0;
  double y0 = 0;
  double y_per_column = 0;
  double y_per_row = -1;
  // One unit of x and y: degrees in a geographic CRS, else metres.
  double unit = 1;

  // A pixel's smaller extent along x or along y, in their unit.
  double smaller_extent() const;
  double determinant() const { return x_per_column * y_per_row - x_per_row * y_per_column; }
  bool is_axis_aligned() const { return x_per_row == 0 && y_per_column == 0; }
  MapPoint map_of(const PixelPoint& p) const {
    return {.x = x0 + x_per_column * p.column + x_per_row * p.row,
            .y = y0 + y_per_column * p.column + y_per_row * p.row};
  }
  // REQUIRES: determinant() is neither 0 nor NaN.
  PixelPoint pixel_of(const MapPoint& m) const;
  friend bool operator==(const PixelPlane&, const PixelPlane&) = default;
};

// What was found out about a raster's CRS, which takes ten times as long as to open the file.
struct RasterPlacement;
struct RasterCrs;

struct GridInfo {
  std::int64_t width = 0;
  std::int64_t height = 0;
  PixelPlane plane;
  // From here on only where the grid is placed on the globe.
  // How far posts may be apart, in degrees of longitude as of latitude, so that no more than a pixel
  // lies between two of them: a pixel's smaller extent in a geographic CRS, else the smallest of what
  // is measured at several places. Decides the sampling zoom.
  double pixel_deg = 0;
  // The grid's extent. east_deg - west_deg <= 360; east_deg may exceed 180 when the grid crosses the
  // antimeridian (then west_deg is in [-180, 180]).
  RectangleDeg bounds_deg;
  // True when the columns go once round the globe (to a hundredth of a pixel), so that the last
  // pixel's eastern neighbour is the first.
  bool wraps_columns = false;
  // True when the grid is in degrees of WGS84 and not rotated: then a pixel's column depends on the
  // longitude alone and its row on the latitude alone.
  bool is_separable = false;
  std::shared_ptr<const RasterPlacement> placement;
};

class RasterGrid {
 public:
  // Finds the way from the globe to the grid's CRS and measures the grid there: fills in what
  // `shape` does not say yet. None where the CRS does not lead to the globe; pixel_deg is 0 or the
  // bounds are empty where the grid does not lie on it.
  static std::optional<RasterGrid> place(const GridInfo& shape, const RasterCrs& crs);
  // The same again, without looking for the way. REQUIRES: info of a grid that was placed.
  explicit RasterGrid(const GridInfo& info);
  ~RasterGrid();
  RasterGrid(RasterGrid&&) noexcept;
  RasterGrid& operator=(RasterGrid&&) noexcept;

  const GridInfo& info() const { return info_; }

  // Where a point of the globe (WGS84) lies on the grid; may lie outside it. Exactly transformed,
  // then rounded to 1/1024 pixel, so that the same on every processor; in degrees of WGS84: not
  // rounded.
  // Where the CRS goes round the globe along x, x is first moved by whole turns to within half a
  // turn of the grid's middle. None where the CRS does not reach the point.
  std::optional<PixelPoint> pixel_at(double longitude_deg, double latitude_deg) const;
  // The way back; none where it does not lead to the globe.
  std::optional<LonLat> globe_at(const PixelPoint& point) const;

 private:
  RasterGrid(GridInfo info, std::unique_ptr<CrsTransform> transform);
  void measure();

  GridInfo info_;
  std::unique_ptr<CrsTransform> transform_;  // null where degrees stay as they are
  double turn_ = 0;                          // along x; 0: none
  double middle_x_ = 0;
};

// How many columns make a turn round the globe, whole or not; 0 where the grid's columns do not go
// round it. REQUIRES: a placement.
double columns_round_globe(const GridInfo& info);

// The same where it is a whole number to a hundredth of a pixel, so that columns a turn apart are one;
// else 0.
std::int64_t columns_of_a_turn(const GridInfo& info);

}  // namespace qmpipe
