// Which rasters lie on one grid of pixels, as the files do that a DEM was cut into: they are then one
// raster for all that is read between pixels, and no seam shows where they meet.
//
// Joined are rasters of one CRS, one pixel size and one phase (their pixels' corners fall on each
// other's) that touch or overlap, directly or through others; also across the line where the columns
// have gone round the globe. "One" is to a hundredth of a pixel, to which places are exact.
// Guarantees: what is joined, and with which grid, does not depend on the order of the rasters. The
// grid of a raster that was cut is the uncut raster's, bit for bit, where each file says its corner
// in the same digits.
#pragma once

#include <span>

#include "formats/sources/raster_source.h"

namespace qmpipe {

// Fills in what the infos say of whole grids; their pixel_deg is then the whole grid's.
// REQUIRES: rasters that were placed on the globe.
void join_grids(std::span<RasterInfo> rasters);

}  // namespace qmpipe
