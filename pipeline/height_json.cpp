#include "pipeline/height_json.h"

#include <nlohmann/json.hpp>

namespace qmpipe {
namespace {

using nlohmann::json;

// What is read under a name, or what is wrong with it.
template <class Value, class Read>
void read_named(const json& object, const char* name, const Read& read, std::optional<Value>& into,
                std::string& problem) {
  const auto it = object.find(name);
  if (it == object.end() || !problem.empty()) return;
  const Result<Value> value = read(*it);
  if (value) {
    into = *value;
  } else {
    problem = std::string("the recipe's \"") + name + "\": " + value.error().message;
  }
}

Result<double> number(const json& value) {
  if (!value.is_number()) return Error{"it is no number"};
  return value.get<double>();
}

}  // namespace

std::string write_heights(const HeightOptions& heights) {
  json object = json::object();
  if (heights.voids) object["void"] = text_of(*heights.voids);
  if (heights.z_scale) object["z-scale"] = *heights.z_scale;
  if (heights.z_offset_m) object["z-offset"] = *heights.z_offset_m;
  return object.dump();
}

Result<HeightOptions> parse_heights(const std::string& text) {
  const json object = json::parse(text, nullptr, false);
  if (!object.is_object()) return Error{"the recipe's \"heights\" is no JSON object"};
  HeightOptions heights;
  std::string problem;
  read_named(
      object, "void",
      [](const json& value) -> Result<VoidValues> {
        if (!value.is_string()) return Error{"it is no text"};
        return void_values_named(value.get<std::string>());
      },
      heights.voids, problem);
  read_named(object, "z-scale", number, heights.z_scale, problem);
  read_named(object, "z-offset", number, heights.z_offset_m, problem);
  if (const auto fault = fault_of(heights); problem.empty() && fault) problem = fault->message;
  if (!problem.empty()) return Error{problem};
  return heights;
}

}  // namespace qmpipe
