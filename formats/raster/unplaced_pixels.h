// Pixels of a raster that no place on the globe leads to: beyond the edge of the map that a projection
// makes, or a turn beside it where the projection does not go round. For formats/ only.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/raster/grid.h"

namespace qmpipe {

struct PixelIndex {
  std::int64_t column = 0;
  std::int64_t row = 0;
};

struct UnplacedPixels {
  // In rows from the top, of those that were looked at.
  std::vector<PixelIndex> pixels;
  std::int64_t looked_at = 0;
};

// Looks at 17 x 17 pixels, those in the corners among them.
UnplacedPixels unplaced_pixels(const RasterGrid& grid);

}  // namespace qmpipe
