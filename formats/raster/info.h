// What is known of a raster once it is open.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/crs/vertical.h"
#include "formats/raster/grid.h"

namespace qmpipe {

// The CRS of x and y.
struct CrsSummary {
  std::string name;
  std::string wkt;  // empty: unknown
  bool is_geographic = false;
  // How longitude and latitude become this CRS, in PROJ's words; of rasters that are placed on the globe.
  std::string transformation;
};

// What the band's numbers are.
struct BandHeights {
  std::string type_name;  // GDAL's name of the band's type, e.g. "Int16"
  std::string unit;       // as the band declares it, "m" when it is silent
  double metres_per_unit = 1;
  // Above what the CRS says that heights are, and its name for it.
  HeightReference reference = HeightReference::kUnknown;
  std::string vertical_name;
};

// How the file is read.
struct BlockLayout {
  std::int64_t width = 0;
  std::int64_t height = 0;
  // What a SourceBlockCache keeps as one block, in pixels: one or more of the file's.
  std::int64_t cached_width = 0;
  std::int64_t cached_height = 0;
  std::int64_t cached_bytes = 0;
  // What an open handle on the file may keep of the block it read last.
  std::int64_t handle_bytes = 0;
};

// Of rasters that lie on one grid: that grid, and where this one's first pixel is on it
// (formats/sources/joined_grids.h).
struct GridPart {
  std::shared_ptr<const GridInfo> whole;  // none: it is alone on its own
  std::int64_t column = 0;
  std::int64_t row = 0;
};

struct RasterInfo : GridInfo {
  std::string path;
  // What was opened in the end: of a file with several grids or an archive the one that is read.
  std::string opened_name;
  std::string driver;
  CrsSummary crs;
  BandHeights band;
  BlockLayout blocks;
  GridPart part;
  // What the file leaves open and was assumed, as sentences without a full stop ("the file names no
  // CRS; ..."); the program tells the user.
  std::vector<std::string> assumptions;
};

// On the globe every point must have a pixel; in the plane of its own CRS a raster needs no way from
// there to the globe, nor a CRS at all (then x and y are metres), nor a geotransform (then a pixel is
// a metre).
enum class Placing { kGlobe, kPlane };

}  // namespace qmpipe
