// Where a raster's pixels lie in its CRS, and what stands against it, each with its own remedy. For
// formats/ only.
#pragma once

#include <optional>
#include <string>

#include "formats/raster/crs.h"
#include "formats/raster/grid.h"
#include "formats/raster/info.h"

class GDALDataset;

namespace qmpipe {

// Throws IoError for a raster that is placed by points or by formulas, and by no geotransform: no CRS
// would mend that.
void require_no_points(GDALDataset& dataset, const std::string& path);

// Whether it is of a body as large as Earth, as far as it says.
bool is_of_earth_size(const RasterCrs& crs);

// Throws IoError for a CRS of another body: on the globe, and for its degrees in a plane too, since
// lengths are measured on Earth.
void require_earth(const RasterCrs& crs, const std::string& path, Placing placing);

// None when the file has no geotransform and does not need one: in a plane without CRS. Throws IoError.
std::optional<PixelPlane> plane_of(GDALDataset& dataset, const std::string& path, CrsNeed need);

// Throws where pixels in degrees lie beyond any that there are: UsageError when the user has named the
// CRS, else IoError.
void require_degrees(const GridInfo& grid, const RasterCrs& crs, const std::string& path,
                     const std::string& override_text);

}  // namespace qmpipe
