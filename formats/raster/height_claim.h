// How much a grid looks like heights, by what CF metadata and its name say. For formats/ only.
#pragma once

#include <string>

class GDALRasterBand;

namespace qmpipe {

// "depth", "sea_floor_depth_below_geoid" and their like: CF's standard names that count downwards.
bool is_depth_name(const std::string& standard_name);

struct HeightClaim {
  int weight = 0;      // more is more
  std::string reason;  // "its standard_name is 'altitude'"; empty: there is none
};

// `name`: of the subdataset, such as NETCDF:"a.nc":elevation.
HeightClaim height_claim_of(GDALRasterBand& band, const std::string& name);

// An item of the band's metadata in lower case, empty where it has none.
std::string lower_item(GDALRasterBand& band, const char* name);

}  // namespace qmpipe
