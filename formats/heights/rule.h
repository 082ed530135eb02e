// How the raw values of a band become heights in metres. For formats/ only.
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "formats/raster/crs.h"
#include "formats/raster/height_options.h"

class GDALRasterBand;

namespace qmpipe {

// Nothing is a height that is more than this, raw or in metres, whatever a file says.
inline constexpr double kLargestHeight = 1e30;

struct HeightRule {
  // NaN where none is declared: nothing equals it.
  double void_value = std::numeric_limits<double>::quiet_NaN();
  std::vector<double> more_void_values = {};
  double lowest_raw = -kLargestHeight;
  double highest_raw = kLargestHeight;
  bool has_mask = false;
  bool is_float = false;  // of 32 bits
  double scale = 1;
  double offset = 0;
  double metres_per_unit = 1;
  double direction = 1;  // -1: depths, positive downwards
  // What the user says of the metres that come of this.
  double z_scale = 1;
  double z_offset_m = 0;

  // Makes raw values NaN that are voids.
  void mark_voids(std::span<double> raws) const;
  // Of a raw value that is no void. Rises or falls all along with the raw value.
  double height_m(double raw) const {
    return (raw * scale + offset) * metres_per_unit * direction * z_scale + z_offset_m;
  }
  // Both: voids become NaN, the others metres.
  void apply(std::span<double> values) const;
};

struct RuledHeights {
  HeightRule rule;
  std::string unit;  // as the band or its CRS says it, "m" where both are silent
  std::vector<std::string> assumptions;
};

// `driver`: GDAL's name of the file's format.
RuledHeights height_rule_of(GDALRasterBand& band, const std::string& driver, const RasterCrs& crs,
                            const HeightOptions& options);

}  // namespace qmpipe
