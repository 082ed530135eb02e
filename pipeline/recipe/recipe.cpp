#include "pipeline/recipe/recipe.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "pipeline/common/height_json.h"

namespace qmpipe {
namespace {

template <class Value>
struct Named {
  Value value;
  const char* name;
};

constexpr Named<Resampling> kResamplings[] = {{Resampling::kBilinear, "bilinear"},
                                              {Resampling::kCubic, "cubic"},
                                              {Resampling::kNearest, "nearest"}};
constexpr Named<Reduction> kReductions[] = {{Reduction::kMean, "mean"},
                                            {Reduction::kSubsample, "subsample"},
                                            {Reduction::kMax, "max"},
                                            {Reduction::kMin, "min"}};

template <class Value, std::size_t kCount>
std::string name_in(const Named<Value> (&table)[kCount], Value value) {
  for (const auto& entry : table) {
    if (entry.value == value) return entry.name;
  }
  QMPIPE_CHECK(false);
  return {};
}

template <class Value, std::size_t kCount>
Result<Value> value_in(const Named<Value> (&table)[kCount], const std::string& name,
                       const char* what) {
  std::string known;
  for (const auto& entry : table) {
    if (entry.name == name) return entry.value;
    known += (known.empty() ? "" : ", ") + std::string(entry.name);
  }
  return Error{fmt::format("\"{}\" is no {}; choose one of {}", name, what, known)};
}

bool read_value(const nlohmann::json& value, std::string& into) {
  if (!value.is_string()) return false;
  into = value.get<std::string>();
  return true;
}
bool read_value(const nlohmann::json& value, bool& into) {
  if (!value.is_boolean()) return false;
  into = value.get<bool>();
  return true;
}
bool read_value(const nlohmann::json& value, std::int32_t& into) {
  if (!value.is_number_integer()) return false;
  // A larger one would wrap into another.
  const double number = value.get<double>();
  if (std::abs(number) > std::numeric_limits<std::int32_t>::max()) return false;
  into = value.get<std::int32_t>();
  return true;
}
bool read_value(const nlohmann::json& value, std::vector<double>& into) {
  if (!value.is_array()) return false;
  into.clear();
  for (const nlohmann::json& element : value) {
    if (!element.is_number()) return false;
    into.push_back(element.get<double>());
  }
  return true;
}

bool read_value(const nlohmann::json& value, std::map<std::string, std::vector<double>>& into) {
  if (!value.is_object()) return false;
  into.clear();
  for (const auto& [name, list] : value.items()) {
    if (!read_value(list, into[name])) return false;
  }
  return true;
}

// Leaves the first problem that was met in `problem`.
template <class Value>
void read_member(const nlohmann::json& object, const char* name, Value& into,
                 std::string& problem) {
  if (!problem.empty()) return;
  const auto it = object.find(name);
  if (it == object.end()) {
    problem = fmt::format("the recipe has no \"{}\"", name);
  } else if (!read_value(*it, into)) {
    problem = fmt::format("the recipe's \"{}\" has the wrong type", name);
  }
}

template <class Value>
void read_named(const nlohmann::json& object, const char* name,
                Result<Value> (*parse)(const std::string&), Value& into, std::string& problem) {
  std::string text;
  read_member(object, name, text, problem);
  if (!problem.empty()) return;
  const Result<Value> value = parse(text);
  if (value) {
    into = *value;
  } else {
    problem = value.error().message;
  }
}

void read_heights(const nlohmann::json& object, HeightOptions& into, std::string& problem) {
  const auto it = object.find("heights");
  if (it == object.end()) return;
  const Result<HeightOptions> heights = parse_heights(it->dump());
  if (heights) {
    into = *heights;
  } else {
    problem = heights.error().message;
  }
}

Result<Projection> projection_named(const std::string& name) {
  if (name == "geodetic") return Projection::kGeodetic;
  if (name == "mercator") return Projection::kMercator;
  return Error{fmt::format("\"{}\" is no scheme; choose geodetic or mercator", name)};
}

}  // namespace

std::string name_of(Resampling resampling) { return name_in(kResamplings, resampling); }
std::string name_of(Reduction reduction) { return name_in(kReductions, reduction); }
Result<Resampling> resampling_named(const std::string& name) {
  return value_in(kResamplings, name, "resampling");
}
Result<Reduction> reduction_named(const std::string& name) {
  return value_in(kReductions, name, "reduction");
}

std::string name_of(const VoidPolicy& policy) {
  switch (policy.kind) {
    case VoidPolicy::Kind::kHeight:
      return fmt::format("height={}", policy.base_height_m);
    case VoidPolicy::Kind::kOmit:
      return "omit";
    case VoidPolicy::Kind::kPull:
      break;
  }
  return policy.fade_m > 0 ? fmt::format("pull={}", policy.fade_m) : "pull";
}

Result<VoidPolicy> void_policy_named(const std::string& name) {
  if (name == "pull") return VoidPolicy{};
  if (name == "omit") return VoidPolicy{.kind = VoidPolicy::Kind::kOmit};
  const auto value_after = [&name](const std::string& prefix) -> std::optional<double> {
    if (!name.starts_with(prefix)) return std::nullopt;
    double value = 0;
    const char* end = name.data() + name.size();
    const auto [stop, code] = std::from_chars(name.data() + prefix.size(), end, value);
    if (code != std::errc() || stop != end) return std::nullopt;
    return value;
  };
  if (const auto height_m = value_after("height="); height_m && std::abs(*height_m) <= 20000) {
    return VoidPolicy{.kind = VoidPolicy::Kind::kHeight, .base_height_m = *height_m};
  }
  if (const auto fade_m = value_after("pull="); fade_m && *fade_m >= 0.001 && *fade_m <= 1e7) {
    return VoidPolicy{.fade_m = *fade_m};
  }
  return Error{
      fmt::format("\"{}\" is no way to fill voids; choose pull, pull=D with D in metres "
                  "(0.001..10000000), height=H with H in metres (-20000..20000), or omit",
                  name)};
}

std::optional<double> Recipe::error_bound_m(std::int32_t zoom) const {
  const auto at = static_cast<std::size_t>(zoom);
  if (!has_error_bound(method, stop) || at >= tolerance_m.size()) return std::nullopt;
  return tolerance_m[at];
}

ParameterValues Recipe::parameters_at(std::int32_t zoom) const {
  const auto at = static_cast<std::size_t>(zoom);
  ParameterValues values = {{"g_e", tolerance_m[at]}};
  for (const auto& [name, by_zoom] : parameters) values[name] = by_zoom[at];
  return values;
}

double Recipe::side_depth_m(std::int32_t zoom) const {
  return tolerance_m[static_cast<std::size_t>(zoom)] / 4;
}

HeightSteps Recipe::steps_for(std::int32_t zoom, std::span<const float> heights_m) const {
  const auto at = static_cast<std::size_t>(zoom);
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  return tile_steps(height_step_m[at], tolerance_m[at],
                    static_cast<double>(*high) - static_cast<double>(*low));
}

MethodOptions Recipe::options_for(const TileKey& key, const HeightSteps& steps) const {
  return method_options(
      method, stop, parameters_at(key.zoom),
      {.height_steps = steps, .side_depth_m = side_depth_m(key.zoom), .seed = packed(key)});
}

std::string write_recipe(const Recipe& recipe) {
  nlohmann::json object = {
      {"program_version", recipe.program_version},
      {"scheme", recipe.projection == Projection::kGeodetic ? "geodetic" : "mercator"},
      {"sampling_zoom", recipe.sampling_zoom},
      {"min_zoom", recipe.min_zoom},
      {"max_zoom", recipe.max_zoom},
      {"source_crs", recipe.source_crs},
      {"resampling", name_of(recipe.resampling)},
      {"reduce", name_of(recipe.reduction)},
      {"nodata", name_of(recipe.voids)},
      {"nodata_base_zoom", recipe.voids.base_zoom},
      {"method", name_of(recipe.method)},
      {"tolerance_m", recipe.tolerance_m},
      {"height_step_m", recipe.height_step_m},
      {"stop", name_of(recipe.stop)},
      {"parameters", recipe.parameters},
      {"normals", recipe.normals}};
  if (!recipe.heights.is_default())
    object["heights"] = nlohmann::json::parse(write_heights(recipe.heights));
  return object.dump();
}

Result<Recipe> parse_recipe(const std::string& text) {
  const nlohmann::json object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object()) return Error{"the recipe is no JSON object"};
  Recipe recipe;
  std::string problem;
  read_member(object, "program_version", recipe.program_version, problem);
  read_named(object, "scheme", projection_named, recipe.projection, problem);
  read_member(object, "sampling_zoom", recipe.sampling_zoom, problem);
  read_member(object, "min_zoom", recipe.min_zoom, problem);
  read_member(object, "max_zoom", recipe.max_zoom, problem);
  read_member(object, "source_crs", recipe.source_crs, problem);
  read_heights(object, recipe.heights, problem);
  read_named(object, "resampling", resampling_named, recipe.resampling, problem);
  read_named(object, "reduce", reduction_named, recipe.reduction, problem);
  read_named(object, "nodata", void_policy_named, recipe.voids, problem);
  // Sets of earlier versions have none; their voids, which this decides, are never measured.
  if (object.contains("nodata_base_zoom")) {
    read_member(object, "nodata_base_zoom", recipe.voids.base_zoom, problem);
  }
  read_named(object, "method", method_named, recipe.method, problem);
  read_member(object, "tolerance_m", recipe.tolerance_m, problem);
  read_member(object, "height_step_m", recipe.height_step_m, problem);
  read_named(object, "stop", stop_named, recipe.stop, problem);
  read_member(object, "parameters", recipe.parameters, problem);
  read_member(object, "normals", recipe.normals, problem);
  if (!problem.empty()) return Error{problem};
  if (recipe.min_zoom < 0 || recipe.max_zoom < recipe.min_zoom ||
      recipe.sampling_zoom < recipe.max_zoom || recipe.sampling_zoom > kMaxZoom ||
      recipe.voids.base_zoom < 0 || recipe.voids.base_zoom > kMaxZoom) {
    return Error{"the recipe's zooms do not fit together"};
  }
  const auto zooms = static_cast<std::size_t>(recipe.max_zoom) + 1;
  if (recipe.tolerance_m.size() != zooms || recipe.height_step_m.size() != zooms) {
    return Error{"the recipe does not list one tolerance and one height step for each zoom"};
  }
  // Metres on Earth: 1e308 is a number too.
  const auto is_length = [](double value) { return value >= 0 && value <= 1e7; };
  for (const std::vector<double>* values : {&recipe.tolerance_m, &recipe.height_step_m}) {
    if (!std::all_of(values->begin(), values->end(), is_length)) {
      return Error{"a tolerance or height step of the recipe is no length on Earth"};
    }
  }
  for (const auto& [name, values] : recipe.parameters) {
    if (values.size() != zooms) {
      return Error{fmt::format("the recipe does not list one {} for each zoom", name)};
    }
  }
  return recipe;
}

}  // namespace qmpipe
