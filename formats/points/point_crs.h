// Which CRS a point cloud is in: from the user, a LAS file's records, or a .prj file beside it. For
// formats/ only.
#pragma once

#include <string>

#include "formats/points/las_file.h"
#include "formats/raster/crs.h"

namespace qmpipe {

// `override_text` as in crs_of(); a plane in metres, without text, where nobody says. Throws IoError
// when the file's own words cannot be understood, UsageError when the user's cannot.
RasterCrs crs_of_points(const std::string& path, const LasCrs& crs,
                        const std::string& override_text);

// Metres in one unit of height.
double metres_per_height_unit(const RasterCrs& crs);

}  // namespace qmpipe
