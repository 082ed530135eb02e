#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <string_view>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "pipeline/recipe/method.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kMostParameterFileBytes = 1 << 20;

// Defaults: Campos et al. 2020, Table 3, but for g_g (pipeline/recipe/method.h says why).
constexpr ParameterInfo kParameters[] = {
    {"g_e", "tolerance: largest vertical error, metres", "15000/2", 0.0005, 1e7, false},
    {"g_g", "cells a side of the initial grid", "0", 0, 256, true},
    {"e_e", "edges at which edge collapse stops", "5000,5000,5000,5000,1000", 5, 1e9, true},
    {"e_v", "weight of the volume in the cost", "0.5", 0, 1e6, false},
    {"e_b", "weight of the boundary in the cost", "0.5", 0, 1e6, false},
    {"e_s", "weight of the triangles' shape in the cost", "1e-10", 0, 1e6, false},
    {"p_e", "largest error of borders and sharp edges, metres", "1024/2", 0, 1e9, false},
    {"p_b", "longest edge on a border, % of the side", "10", 0.1, 100, false},
    {"p_m", "fewest points of a sharp edge line", "25", 2, 1e6, true},
    {"r_r", "points to remove, %", "75", 0, 100, false},
    {"d_g", "cell size, metres", "500000/2", 1e-3, 1e8, false},
    {"h_c", "most points of a cluster", "100,100,100,100,100,100,50", 1, 1e6, true},
    {"h_v", "largest surface variation of a cluster", "0.001", 1e-12, 1.0 / 3, false},
    {"w_p", "points to retain, %", "1,1,1,1,5,15,25", 0.01, 100, false},
    {"w_r", "radius of a point's neighbourhood, metres", "5120/2", 1e-6, 1e8, false},
    {"w_i", "rounds of regularization", "15", 1, 1000, true},
};

std::optional<double> number_in(std::string_view text) {
  double value = 0;
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size() || !std::isfinite(value)) {
    return std::nullopt;
  }
  return value;
}

const ParameterInfo* find_parameter(const std::string& name) {
  const auto* const found =
      std::find_if(std::begin(kParameters), std::end(kParameters),
                   [&name](const ParameterInfo& info) { return info.name == name; });
  return found == std::end(kParameters) ? nullptr : found;
}

void require_in_range(const ParameterInfo& info, double value, const std::string& where) {
  if (value >= info.least && value <= info.most && (!info.whole || value == std::floor(value))) {
    return;
  }
  throw UsageError(fmt::format("{}{}: {:g} cannot be used ({}); give {:g} to {:g}{}", info.name,
                               where, value, info.meaning, info.least, info.most,
                               info.whole ? ", a whole number" : ""));
}

ZoomSeries series_in(const nlohmann::json& value, const std::string& path,
                     const std::string& name) {
  std::vector<double> values;
  if (value.is_number()) values.push_back(value.get<double>());
  if (value.is_array()) {
    for (const nlohmann::json& element : value) {
      if (element.is_number()) values.push_back(element.get<double>());
    }
    if (values.size() != value.size()) values.clear();
  }
  if (!values.empty()) return ZoomSeries(values);
  if (value.is_string()) {
    const auto series = ZoomSeries::parse(value.get<std::string>());
    if (series) return *series;
  }
  throw UsageError(fmt::format(
      "{}: \"{}\" must be a number, a list of numbers by zoom, or a text such as \"15000/2\"", path,
      name));
}

}  // namespace

ZoomSeries::ZoomSeries(std::vector<double> values, double factor)
    : values_(std::move(values)), factor_(factor) {
  QMPIPE_CHECK(!values_.empty());
}

double ZoomSeries::at(std::int32_t zoom) const {
  const auto k = static_cast<std::size_t>(zoom);
  if (k < values_.size()) return values_[k];
  return values_.back() * whole_power(factor_, static_cast<int>(k + 1 - values_.size()));
}

std::string ZoomSeries::text() const {
  std::string text = fmt::format("{}", fmt::join(values_, ","));
  if (factor_ == 0.5) text += "/2";
  if (factor_ == 2) text += "*2";
  return text;
}

Result<ZoomSeries> ZoomSeries::parse(const std::string& text) {
  std::string_view rest = text;
  double factor = 1;
  if (rest.ends_with("/2")) factor = 0.5;
  if (rest.ends_with("*2")) factor = 2;
  if (factor != 1) rest.remove_suffix(2);
  std::vector<double> values;
  while (true) {
    const auto comma = rest.find(',');
    const auto value = number_in(rest.substr(0, comma));
    if (!value) {
      return Error{fmt::format(
          "\"{}\" is no value: give a number, numbers for zoom 0, 1, 2... as in 5000,5000,1000, or "
          "one with /2 or *2 behind it, halved or doubled at each deeper zoom",
          text)};
    }
    values.push_back(*value);
    if (comma == std::string_view::npos) break;
    rest.remove_prefix(comma + 1);
  }
  return ZoomSeries(values, factor);
}

std::span<const ParameterInfo> all_parameters() { return kParameters; }

MethodParameters::MethodParameters() {
  for (const ParameterInfo& info : kParameters) {
    series_.emplace(info.name, *ZoomSeries::parse(info.default_text));
  }
}

const ZoomSeries& MethodParameters::of(const std::string& name) const {
  const auto found = series_.find(name);
  QMPIPE_CHECK(found != series_.end());
  return found->second;
}

void MethodParameters::set(const std::string& name, const ZoomSeries& series) {
  const ParameterInfo* info = find_parameter(name);
  if (info == nullptr) {
    std::string known;
    for (const ParameterInfo& one : kParameters) {
      known += (known.empty() ? "" : ", ") + std::string(one.name);
    }
    throw UsageError(
        fmt::format("\"{}\" is no parameter of any method; there are {}", name, known));
  }
  for (const double value : series.values()) require_in_range(*info, value, "");
  series_.insert_or_assign(name, series);
}

void read_parameter_file(const std::string& path, MethodParameters& parameters) {
  const auto bytes = read_file_bytes(path, kMostParameterFileBytes);
  if (!bytes) throw IoError("cannot read the parameters", path, bytes.error().message, "");
  const nlohmann::json object =
      nlohmann::json::parse(bytes->begin(), bytes->end(), nullptr, false, true);
  if (!object.is_object()) {
    throw UsageError(path + ": no JSON object, such as {\"g_e\": \"15000/2\", \"g_g\": 10}");
  }
  for (const auto& [name, value] : object.items()) {
    try {
      parameters.set(name, series_in(value, path, name));
    } catch (const UsageError& error) {
      throw UsageError(path + ": " + error.what());
    }
  }
}

ParameterValues values_at(const MethodParameters& parameters, Method method, Stop stop,
                          std::int32_t zoom) {
  ParameterValues values;
  for (const ParameterInfo& info : parameters_of(method, stop)) {
    const double value = parameters.of(info.name).at(zoom);
    require_in_range(info, value, fmt::format(" at zoom {}", zoom));
    values.emplace(info.name, value);
  }
  return values;
}

}  // namespace qmpipe
