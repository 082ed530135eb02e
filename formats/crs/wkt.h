// A CRS of GDAL's as text. For formats/ only.
#pragma once

#include <string>

class OGRSpatialReference;

namespace qmpipe {

// WKT2:2019; empty for a CRS that cannot be written so.
std::string wkt_of(const OGRSpatialReference& crs);

}  // namespace qmpipe
