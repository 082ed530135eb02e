// The extent of a raster on the globe, and the size of its pixels there. For formats/ only.
#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <vector>

#include "formats/crs/transform.h"
#include "formats/raster/grid.h"

namespace qmpipe {

struct RasterSize {
  std::int64_t width = 0;
  std::int64_t height = 0;
};

using ToGlobe = std::function<std::optional<LonLat>(const PixelPoint&)>;
using ToRaster = std::function<std::optional<PixelPoint>(const LonLat&)>;

// Bounds of a raster in any CRS: from its outline, 256 steps a side, and a grid of points inside.
// West is in [-180, 180]; all longitudes when a pole is inside or when less than 12 degrees stay
// free. None when no point of the raster lies on the globe.
std::optional<RectangleDeg> bounds_on_globe(const RasterSize& size, const ToGlobe& to_globe,
                                            const ToRaster& to_raster);

// West moved into [-180, 180), at most one turn wide, latitudes cut at the poles.
RectangleDeg tidy_bounds(const RectangleDeg& bounds);

// See GridInfo::pixel_deg, measured on the globe at 5 x 5 places; 0 when it cannot be measured anywhere.
double smallest_pixel_deg(const RasterSize& size, const ToGlobe& to_globe);

}  // namespace qmpipe
