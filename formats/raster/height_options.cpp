#include "formats/raster/height_options.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <string_view>
#include <system_error>
#include <utility>

#include "formats/bytes/letter_case.h"

namespace qmpipe {
namespace {

std::optional<double> finite_number(std::string_view text) {
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return std::isfinite(value) ? std::optional(value) : std::nullopt;
}

// False where it is no void value, or a second bound of the same kind.
bool add_void(std::string_view text, VoidValues& voids) {
  const bool is_below = text.starts_with('<');
  const bool is_above = text.starts_with('>');
  const std::optional<double> value = finite_number(text.substr(is_below || is_above ? 1 : 0));
  if (!value) return false;
  std::optional<double>& bound = is_below ? voids.below : voids.above;
  if (is_below || is_above) return !std::exchange(bound, value);
  if (std::find(voids.values.begin(), voids.values.end(), *value) == voids.values.end()) {
    voids.values.push_back(*value);
  }
  return true;
}

}  // namespace

HeightOptions HeightOptions::or_else(const HeightOptions& other) const {
  HeightOptions both = *this;
  if (!both.voids) both.voids = other.voids;
  if (!both.band) both.band = other.band;
  if (!both.encoding) both.encoding = other.encoding;
  if (!both.z_scale) both.z_scale = other.z_scale;
  if (!both.z_offset_m) both.z_offset_m = other.z_offset_m;
  if (both.open_options.empty()) both.open_options = other.open_options;
  if (both.config.empty()) both.config = other.config;
  return both;
}

std::string text_of(const HeightOptions& options) {
  std::vector<std::string> parts;
  if (options.voids) parts.push_back("--void " + text_of(*options.voids));
  if (options.band) parts.push_back(fmt::format("--band {}", *options.band));
  if (options.encoding) parts.push_back("--encoding " + name_of(*options.encoding));
  if (options.z_scale) parts.push_back(fmt::format("--z-scale {}", *options.z_scale));
  if (options.z_offset_m) parts.push_back(fmt::format("--z-offset {}", *options.z_offset_m));
  for (const auto& [flag, list] :
       {std::pair{"--oo ", &options.open_options}, std::pair{"--config ", &options.config}}) {
    for (const std::string& option : *list) {
      parts.push_back(flag + (is_secret(option) ? option_name(option) + "=..." : option));
    }
  }
  return fmt::format("{}", fmt::join(parts, " "));
}

std::optional<Error> fault_of(const HeightOptions& options) {
  constexpr double kLargestFactor = 1e9;
  constexpr double kLargestOffsetM = 1e7;
  const double factor = std::abs(options.z_scale.value_or(1));
  if (!(factor >= 1 / kLargestFactor && factor <= kLargestFactor)) {
    return Error{fmt::format("--z-scale {}: give a factor other than 0, such as -1 or 0.3048",
                             *options.z_scale)};
  }
  if (!(std::abs(options.z_offset_m.value_or(0)) <= kLargestOffsetM)) {
    return Error{fmt::format("--z-offset {}: give metres between -{:.0f} and {:.0f}",
                             *options.z_offset_m, kLargestOffsetM, kLargestOffsetM)};
  }
  if (options.band.value_or(1) < 1) {
    return Error{fmt::format("--band {}: bands are counted from 1", *options.band)};
  }
  if (options.band && options.encoding) {
    return Error{"--band and --encoding: three bands make an encoded height; give one of the two"};
  }
  return std::nullopt;
}

std::string text_of(const VoidValues& voids) {
  std::vector<std::string> parts;
  for (const double value : voids.values) parts.push_back(fmt::format("{}", value));
  if (voids.below) parts.push_back(fmt::format("<{}", *voids.below));
  if (voids.above) parts.push_back(fmt::format(">{}", *voids.above));
  return fmt::format("{}", fmt::join(parts, ","));
}

Result<VoidValues> void_values_named(const std::string& text) {
  VoidValues voids;
  for (std::string_view rest = text;;) {
    const std::size_t comma = rest.find(',');
    if (!add_void(rest.substr(0, comma), voids)) {
      return Error{
          fmt::format("\"{}\" is no list of void values; give values as the band stores them, at "
                      "most one <X and "
                      "one >Y among them, such as -9999 or \"<-12000,>9000\"",
                      text)};
    }
    if (comma == std::string_view::npos) return voids;
    rest.remove_prefix(comma + 1);
  }
}

std::string name_of(HeightEncoding encoding) {
  return encoding == HeightEncoding::kTerrainRgb ? "terrain-rgb" : "terrarium";
}

Result<HeightEncoding> height_encoding_named(const std::string& name) {
  for (const HeightEncoding encoding : {HeightEncoding::kTerrainRgb, HeightEncoding::kTerrarium}) {
    if (name == name_of(encoding)) return encoding;
  }
  return Error{
      fmt::format("\"{}\" is no encoding of heights; choose terrain-rgb or terrarium", name)};
}

std::string option_name(const std::string& option) { return option.substr(0, option.find('=')); }

bool has_option(const std::vector<std::string>& options, const std::string& name) {
  return std::any_of(options.begin(), options.end(),
                     [&name](const std::string& option) { return option_name(option) == name; });
}

bool is_secret(const std::string& option) {
  static constexpr std::array<const char*, 14> kWords = {
      "key", "secret",    "token",      "pass", "pwd",        "auth",   "cookie",
      "sas", "signature", "credential", "user", "connection", "header", "account"};
  const std::string name = lower_case(option_name(option));
  return std::any_of(kWords.begin(), kWords.end(),
                     [&name](const char* word) { return name.find(word) != std::string::npos; });
}

}  // namespace qmpipe
