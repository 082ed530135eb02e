// What a CRS says about heights: above what, in which unit, which way up.
#pragma once

#include <string>

namespace qmpipe {

enum class HeightReference {
  kUnknown,    // nothing is said
  kEllipsoid,  // geodetic heights
  kDatum,      // above a geoid, a tide, a gauge
};

struct VerticalCrs {
  HeightReference reference = HeightReference::kUnknown;
  std::string name;  // "NAP height"
  std::string unit;  // empty where none is named
  double metres_per_unit = 1;
  bool points_down = false;  // depths
};

// Of the third axis of a CRS, or of the heights that a compound one is composed with; nothing for any
// other text.
VerticalCrs vertical_crs_of(const std::string& wkt);

}  // namespace qmpipe
