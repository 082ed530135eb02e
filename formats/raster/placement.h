// What is found out about a raster's CRS once and then kept: for formats/ only.
#pragma once

#include <string>

#include "formats/raster/crs.h"

namespace qmpipe {

struct RasterPlacement {
  RasterCrs crs;
  // Degrees of WGS84: no transformation need be called at all.
  bool is_identity = false;
  // Once round the globe along x, in the CRS's unit; 0 where x does not go round it.
  double turn = 0;
  std::string transformation = {};
  bool is_ballpark = false;
};

}  // namespace qmpipe
