// What is known of a raster once it is open.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/crs/vertical.h"
#include "formats/raster/grid.h"

namespace qmpipe {

struct RasterInfo : GridInfo {
  std::string path;
  // What was opened in the end: of a file with several grids or an archive the one that is read.
  std::string opened_name;
  std::string driver;
  std::string crs_name;
  std::string crs_wkt;  // of x and y; empty: unknown
  bool is_geographic = false;
  // Above what the CRS says that heights are, and its name for it.
  HeightReference height_reference = HeightReference::kUnknown;
  std::string vertical_name;
  std::string type_name;  // GDAL's name of the band's type, e.g. "Int16"
  std::string unit;       // as the band declares it, "m" when it is silent
  double metres_per_unit = 1;
  std::int64_t block_width = 0;
  std::int64_t block_height = 0;
  // What a SourceBlockCache keeps as one block, in pixels: one or more of the file's.
  std::int64_t cached_width = 0;
  std::int64_t cached_height = 0;
  std::int64_t cached_block_bytes = 0;
  // What an open handle on the file may keep of the block it read last.
  std::int64_t handle_bytes = 0;
  // How longitude and latitude become the raster's CRS, in PROJ's words; where it is placed on the
  // globe.
  std::string transformation;
  // Of rasters that lie on one grid: that grid, and where this one's first pixel is on it
  // (formats/sources/joined_grids.h). None: it is alone on its own.
  std::shared_ptr<const GridInfo> whole;
  std::int64_t whole_column = 0;
  std::int64_t whole_row = 0;
  // What the file leaves open and was assumed, as sentences without a full stop ("the file names no
  // CRS; ..."); the program tells the user.
  std::vector<std::string> assumptions;
};

// On the globe every point must have a pixel; in the plane of its own CRS a raster needs no way from
// there to the globe, nor a CRS at all (then x and y are metres), nor a geotransform (then a pixel is
// a metre).
enum class Placing { kGlobe, kPlane };

}  // namespace qmpipe
