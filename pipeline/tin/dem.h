// A whole DEM in memory, at its own pixels: what `qmpipe tin` makes one TIN of.
//
// Frames: pixels as in formats/sources/raster_source.h, a post at the centre of each; posts as in
// stages/posts/post_grid.h, i eastwards (with the CRS's x) and j northwards (with its y), whichever way the
// file's columns and rows run.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/sources/raster_source.h"
#include "stages/posts/post_grid.h"

namespace qmpipe {

// The distance of two posts in metres.
struct PostSpacing {
  double x_m = 0;
  double y_m = 0;
};

struct Dem {
  RasterInfo info;
  PostGrid grid;  // on a plane
  // Row by row from the south; a void has the flag 0 and a height filled from the valid ones around
  // it.
  std::vector<float> heights_m;
  std::vector<std::uint8_t> valid;
  std::int64_t void_count = 0;
  // Of the valid posts.
  float low_m = 0;
  float high_m = 0;

  std::size_t post_count() const { return grid.post_count(); }
  // Where the column and row of a place of the grid, which may lie between posts, are in the raster.
  PixelPoint pixel_of(double u, double v) const;
};

// Where columns and rows run against x and y.
bool columns_run_west(const PixelPlane& plane);
bool rows_run_south(const PixelPlane& plane);

// Linear units are metres already or converted; degrees are measured on the WGS84 ellipsoid at the
// raster's middle latitude. Throws IoError, with the remedy, for a rotated raster, for fewer than 2 or
// more than 32768 posts a side, and for degrees that lie not on the globe.
PostSpacing post_spacing(const RasterInfo& info);

// Reads it all. REQUIRES: a source that post_spacing() accepts. Throws IoError when it cannot be read or
// has no valid pixel.
Dem read_dem(const RasterSource& source);

}  // namespace qmpipe
