#include "formats/crs/wkt.h"

#include <cpl_conv.h>
#include <ogr_spatialref.h>

#include <array>

namespace qmpipe {

std::string wkt_of(const OGRSpatialReference& crs) {
  char* text = nullptr;
  const std::array<const char*, 2> options = {"FORMAT=WKT2_2019", nullptr};
  crs.exportToWkt(&text, options.data());
  std::string wkt = text != nullptr ? text : "";
  CPLFree(text);
  return wkt;
}

}  // namespace qmpipe
