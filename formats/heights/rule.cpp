#include "formats/heights/rule.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <cmath>
#include <optional>

#include "formats/heights/void_height.h"
#include "formats/raster/height_claim.h"
#include "formats/raster/height_unit.h"

namespace qmpipe {
namespace {

// The file's own values went through a float.
double as_stored(double value, GDALDataType type) {
  return type == GDT_Float32 ? static_cast<double>(static_cast<float>(value)) : value;
}

// Whether a band of whole numbers can hold it.
bool fits(double value, GDALDataType type) {
  return GDALDataTypeIsInteger(type) == 0 ||
         (std::isfinite(value) &&
          GDALAdjustValueToDataType(type, value, nullptr, nullptr) == value);
}

double void_value_of(GDALRasterBand& band, std::vector<std::string>& assumptions) {
  int is_set = 0;
  const GDALDataType type = band.GetRasterDataType();
  double value = 0;
  if (type == GDT_Int64) {
    value = static_cast<double>(band.GetNoDataValueAsInt64(&is_set));
  } else if (type == GDT_UInt64) {
    value = static_cast<double>(band.GetNoDataValueAsUInt64(&is_set));
  } else {
    value = band.GetNoDataValue(&is_set);
  }
  if (is_set == 0) return kVoidHeight;
  if (!fits(value, type)) {
    assumptions.push_back(
        fmt::format("the declared void value {} cannot stand in a band of {}; it marks nothing",
                    value, GDALGetDataTypeName(type)));
  }
  return std::abs(value) <= kLargestHeight ? as_stored(value, type) : kVoidHeight;
}

void take_voids(const VoidValues& voids, GDALDataType type, HeightRule& rule) {
  for (const double value : voids.values) rule.more_void_values.push_back(as_stored(value, type));
  if (voids.below) rule.lowest_raw = *voids.below;
  if (voids.above) rule.highest_raw = *voids.above;
}

void take_scale(GDALRasterBand& band, RuledHeights& heights) {
  const double scale = band.GetScale();
  const double offset = band.GetOffset();
  if (std::isfinite(scale) && scale != 0 && std::isfinite(offset)) {
    heights.rule.scale = scale;
    heights.rule.offset = offset;
  } else {
    heights.assumptions.push_back(fmt::format(
        "the band's scale {} and offset {} make no sense and are ignored", scale, offset));
  }
}

void take_unit(GDALRasterBand& band, const RasterCrs& crs, RuledHeights& heights) {
  heights.unit = band.GetUnitType() != nullptr ? band.GetUnitType() : "";
  if (heights.unit.empty() && !crs.vertical.unit.empty()) {
    heights.unit = crs.vertical.unit;
    heights.rule.metres_per_unit = crs.vertical.metres_per_unit;
  } else if (const std::optional<double> metres = metres_per_unit(heights.unit)) {
    heights.rule.metres_per_unit = *metres;
  } else {
    heights.assumptions.push_back("the unit of height '" + heights.unit +
                                  "' is unknown; metres are taken");
  }
  if (!heights.unit.empty()) return;
  heights.unit = "m";
  if (crs.is_geographic || crs.metres_per_unit == 1) return;
  heights.assumptions.push_back(fmt::format(
      "x and y of its CRS are in units of {} m, and nothing names the unit of heights: metres are "
      "taken; if they are in the same unit: --z-scale {}",
      crs.metres_per_unit, crs.metres_per_unit));
}

// What says that the numbers are depths; empty: nothing does.
std::string reason_for_depths(GDALRasterBand& band, const std::string& driver,
                              const RasterCrs& crs) {
  const std::string positive = lower_item(band, "positive");
  const std::string name = lower_item(band, "standard_name");
  if (positive == "down") return "its attribute 'positive' is 'down'";
  if (positive == "up") return "";
  if (is_depth_name(name)) return "its standard_name is '" + name + "'";
  // Heights of a BAG are positive upwards whatever CRS it names.
  if (!crs.vertical.points_down || driver == "BAG") return "";
  return "the axis of '" + crs.vertical.name + "' points down";
}

void take_direction(const std::string& reason, RuledHeights& heights) {
  if (reason.empty()) return;
  heights.rule.direction = -1;
  heights.assumptions.push_back(
      "its values are depths, positive downwards (" + reason +
      "), and are turned into heights; if they are heights as they stand: --z-scale -1");
}

}  // namespace

void HeightRule::mark_voids(std::span<double> raws) const {
  for (const double more : more_void_values) {
    for (double& raw : raws) raw = raw == more ? kVoidHeight : raw;
  }
  // Without branches, so that a row's worth is done several at a time. False for NaN.
  for (double& raw : raws) {
    const bool is_height = (raw >= lowest_raw) & (raw <= highest_raw) &
                           (std::abs(raw) <= kLargestHeight) & (raw != void_value);
    raw = is_height ? raw : kVoidHeight;
  }
}

void HeightRule::apply(std::span<double> values) const {
  mark_voids(values);
  for (double& value : values) {
    const double height = height_m(value);
    value = std::abs(height) <= kLargestHeight ? height : kVoidHeight;
  }
}

RuledHeights height_rule_of(GDALRasterBand& band, const std::string& driver, const RasterCrs& crs,
                            const HeightOptions& options) {
  RuledHeights heights;
  heights.rule.void_value = void_value_of(band, heights.assumptions);
  heights.rule.is_float = band.GetRasterDataType() == GDT_Float32;
  if (options.voids) take_voids(*options.voids, band.GetRasterDataType(), heights.rule);
  heights.rule.z_scale = options.z_scale.value_or(1);
  heights.rule.z_offset_m = options.z_offset_m.value_or(0);
  const int flags = band.GetMaskFlags();
  heights.rule.has_mask = (flags & GMF_ALL_VALID) == 0 && flags != GMF_NODATA;
  take_scale(band, heights);
  take_unit(band, crs, heights);
  take_direction(reason_for_depths(band, driver, crs), heights);
  return heights;
}

}  // namespace qmpipe
