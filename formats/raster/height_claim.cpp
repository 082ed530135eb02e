#include "formats/raster/height_claim.h"

#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <span>

#include "formats/bytes/letter_case.h"
#include "formats/raster/height_unit.h"

namespace qmpipe {
namespace {

constexpr int kByStandardName = 8;
constexpr int kByName = 4;
constexpr int kByUnit = 2;
constexpr int kByType = 1;
constexpr int kOtherThing = -16;

bool has_any(const std::string& text, std::span<const char* const> words) {
  return std::any_of(words.begin(), words.end(),
                     [&text](const char* word) { return text.find(word) != std::string::npos; });
}

bool is_height_name(const std::string& standard_name) {
  static constexpr std::array<const char*, 4> kHeights = {"altitude", "height_above", "elevation",
                                                          "topographic_height"};
  return standard_name == "height" || has_any(standard_name, kHeights);
}

bool says_height(const std::string& name) {
  static constexpr std::array<const char*, 11> kWords = {"elev",  "height",   "depth", "topo",
                                                         "bathy", "altitude", "dem",   "dtm",
                                                         "dsm",   "terrain",  "relief"};
  return name == "z" || name == "alt" || name == "hgt" || has_any(name, kWords);
}

// About heights, and none themselves.
bool is_about_heights(const std::string& name) {
  static constexpr std::array<const char*, 12> kWords = {"uncert",  "error",  "sigma",  "std",
                                                         "mask",    "flag",   "count",  "tid",
                                                         "quality", "source", "weight", "density"};
  return has_any(name, kWords);
}

}  // namespace

std::string lower_item(GDALRasterBand& band, const char* name) {
  const char* const text = band.GetMetadataItem(name);
  return lower_case(text != nullptr ? text : "");
}

bool is_depth_name(const std::string& standard_name) {
  return standard_name == "depth" || standard_name.starts_with("depth_below_") ||
         standard_name.find("_depth_below_") != std::string::npos;
}

HeightClaim height_claim_of(GDALRasterBand& band, const std::string& name) {
  const std::string standard_name = lower_item(band, "standard_name");
  const std::string own_name = lower_case(name.substr(name.find_last_of(":/") + 1));
  const std::string unit = band.GetUnitType() != nullptr ? band.GetUnitType() : "";
  HeightClaim claim;
  // From the weakest on, so that the strongest reason stays.
  if (band.GetRasterDataType() != GDT_Byte) claim.weight += kByType;
  if (!unit.empty() && metres_per_unit(unit)) {
    claim.weight += kByUnit;
    claim.reason = "its unit is '" + unit + "'";
  }
  if (says_height(own_name)) {
    claim.weight += kByName;
    claim.reason = "its name says heights";
  }
  if (is_height_name(standard_name) || is_depth_name(standard_name)) {
    claim.weight += kByStandardName;
    claim.reason = "its standard_name is '" + standard_name + "'";
  }
  if (is_about_heights(own_name) || is_about_heights(standard_name)) claim.weight += kOtherThing;
  return claim;
}

}  // namespace qmpipe
