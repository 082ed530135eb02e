#include "pipeline/common/height_json.h"

#include <nlohmann/json.hpp>

namespace qmpipe {
namespace {

// Nothing that names a file or a server: the recipe is public, and whoever checks a set takes it over.
bool is_harmless(const std::string& option) {
  return option.find_first_not_of(
             "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789_=.,+:;()- ") ==
         std::string::npos;
}

// What is read under a name, or what is wrong with it.
template <class Value, class Read>
void read_named(const nlohmann::json& object, const char* name, const Read& read,
                std::optional<Value>& into, std::string& problem) {
  const auto it = object.find(name);
  if (it == object.end() || !problem.empty()) return;
  const Result<Value> value = read(*it);
  if (value) {
    into = *value;
  } else {
    problem = std::string("the recipe's \"") + name + "\": " + value.error().message;
  }
}

void read_options(const nlohmann::json& object, const char* name, std::vector<std::string>& into,
                  std::string& problem) {
  const auto it = object.find(name);
  if (it == object.end() || !problem.empty()) return;
  // Whatever else it is makes a list of one that is none.
  const nlohmann::json list = it->is_array() ? *it : nlohmann::json::array({nullptr});
  for (const nlohmann::json& option : list) {
    if (!option.is_string() || !is_harmless(option.get<std::string>())) {
      problem = std::string("the recipe's \"") + name + "\" names files or is no list of options";
      return;
    }
    into.push_back(option.get<std::string>());
  }
}

template <class Value>
auto from_text(Result<Value> (*named)(const std::string&)) {
  return [named](const nlohmann::json& value) -> Result<Value> {
    if (!value.is_string()) return Error{"it is no text"};
    return named(value.get<std::string>());
  };
}

Result<std::int32_t> band_number(const nlohmann::json& value) {
  if (!value.is_number_integer() || value.get<double>() > 65535) return Error{"it is no band"};
  return value.get<std::int32_t>();
}

Result<double> number(const nlohmann::json& value) {
  if (!value.is_number()) return Error{"it is no number"};
  return value.get<double>();
}

}  // namespace

std::string write_heights(const HeightOptions& heights) {
  nlohmann::json object = nlohmann::json::object();
  if (heights.voids) object["void"] = text_of(*heights.voids);
  if (heights.band) object["band"] = *heights.band;
  if (heights.encoding) object["encoding"] = name_of(*heights.encoding);
  if (heights.z_scale) object["z-scale"] = *heights.z_scale;
  if (heights.z_offset_m) object["z-offset"] = *heights.z_offset_m;
  // Of configuration the names alone: it goes for GDAL as a whole, keys to somebody's data among it.
  for (const std::string& option : heights.open_options) {
    if (is_secret(option)) continue;
    object[is_harmless(option) ? "oo" : "config"].push_back(
        is_harmless(option) ? option : option_name(option));
  }
  for (const std::string& option : heights.config) {
    if (!is_secret(option)) object["config"].push_back(option_name(option));
  }
  // A name may be any bytes.
  return object.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

Result<HeightOptions> parse_heights(const std::string& text) {
  const nlohmann::json object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object()) return Error{"the recipe's \"heights\" is no JSON object"};
  HeightOptions heights;
  std::string problem;
  read_named(object, "void", from_text(void_values_named), heights.voids, problem);
  read_named(object, "band", band_number, heights.band, problem);
  read_named(object, "encoding", from_text(height_encoding_named), heights.encoding, problem);
  read_options(object, "oo", heights.open_options, problem);
  read_options(object, "config", heights.config, problem);
  read_named(object, "z-scale", number, heights.z_scale, problem);
  read_named(object, "z-offset", number, heights.z_offset_m, problem);
  if (const auto fault = fault_of(heights); problem.empty() && fault) problem = fault->message;
  if (!problem.empty()) return Error{problem};
  return heights;
}

}  // namespace qmpipe
