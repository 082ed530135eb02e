// Finding out which CRS a raster is in: from the user, the file, a .prj file beside it, or (NetCDF
// with longitude and latitude axes) from the names of its axes. For formats/ only.
#pragma once

#include <string>
#include <vector>

#include "formats/crs/transform.h"
#include "formats/crs/vertical.h"

class GDALDataset;

namespace qmpipe {

struct RasterCrs {
  CrsText text;  // horizontal part only
  std::string name;
  bool is_geographic = false;
  double turn = 360;           // once round the globe in the unit of a geographic CRS
  double metres_per_unit = 1;  // of a plane CRS's x and y
  double radius_m = 0;         // of the body's equator; 0: nothing is said
  VerticalCrs vertical;
  // What had to be assumed, as sentences without a full stop.
  std::vector<std::string> assumptions;
};

enum class CrsNeed { kRequired, kOptional };

// `path` is what the user named, `opened` what GDAL opened in the end; `override_text` (anything
// GDAL understands as a CRS) may be empty. Throws IoError when there is no CRS and one is required
// (otherwise it is then a plane in metres, without text), and for one that says nothing about x and y;
// UsageError when the override is such a one, or none.
RasterCrs crs_of(GDALDataset& dataset, const std::string& path, const std::string& opened,
                 const std::string& override_text, CrsNeed need);

}  // namespace qmpipe
