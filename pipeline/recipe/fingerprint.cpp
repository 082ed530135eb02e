#include "pipeline/recipe/fingerprint.h"

#include <fmt/format.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "formats/bytes/hash64.h"
#include "formats/raster/files.h"
#include "pipeline/common/height_json.h"
#include "pipeline/common/version.h"

namespace qmpipe {
namespace {

// The same file whatever folder the program is started in; names that are no paths stay as they are.
std::string absolute_name(const std::string& path) {
  std::error_code code;
  if (!std::filesystem::exists(path, code)) return path;
  const std::filesystem::path absolute = std::filesystem::canonical(path, code);
  return code ? path : absolute.string();
}

nlohmann::json inputs_of(const InputOptions& input) {
  nlohmann::json inputs = nlohmann::json::array();
  for (const std::string& path : input.paths) {
    nlohmann::json files = nlohmann::json::object();
    for (const RasterFile& file : files_of_raster(path, input.heights.open_options)) {
      files[absolute_name(file.path)] = {{"bytes", file.bytes}, {"modified_ns", file.modified_ns}};
    }
    inputs.push_back({{"name", absolute_name(path)}, {"files", files}});
  }
  return inputs;
}

std::string hash_text(const std::string& text) {
  return fmt::format("{:016x}",
                     hash64({reinterpret_cast<const std::uint8_t*>(text.data()), text.size()}, 0));
}

nlohmann::json parameters_of(const BuildOptions& options) {
  const MeshOptions& mesh = options.mesh;
  nlohmann::json tolerance_at = nlohmann::json::object();
  for (const auto& [zoom, metres] : mesh.tolerance_at_m) {
    tolerance_at[std::to_string(zoom)] = metres;
  }
  nlohmann::json parameters = {
      {"--source-crs", options.input.source_crs},
      {"--resampling", name_of(options.input.resampling)},
      {"--reduce", name_of(mesh.reduction)},
      {"--nodata", name_of(mesh.voids)},
      {"--scheme", mesh.projection == Projection::kGeodetic ? "geodetic" : "mercator"},
      {"--min-zoom", mesh.min_zoom},
      {"--max-zoom",
       mesh.max_zoom ? nlohmann::json(*mesh.max_zoom) : nlohmann::json("from the pixels")},
      {"--method", name_of(mesh.method)},
      {"--stop", name_of(mesh.stop)},
      {"--tolerance-at", tolerance_at},
      {"--gzip", options.encode.gzip_level ? nlohmann::json(*options.encode.gzip_level)
                                           : nlohmann::json("none")},
      {"normals", options.encode.normals}};
  const nlohmann::json heights = nlohmann::json::parse(write_heights(options.input.heights));
  for (const auto& [name, value] : heights.items()) parameters["--" + name] = value;
  // Values that are not written.
  std::string hidden;
  for (const auto* list : {&options.input.heights.config, &options.input.heights.open_options}) {
    for (const std::string& option : *list) {
      if (!is_secret(option)) hidden += option + "\n";
    }
  }
  if (!hidden.empty()) parameters["--oo and --config, their values"] = hash_text(hidden);
  for (const ParameterInfo& info : parameters_of(mesh.method, mesh.stop)) {
    parameters[info.name] = mesh.parameters.of(info.name).text();
  }
  // Height steps come from it whatever the method.
  parameters.erase("g_e");
  parameters["g_e (--tolerance)"] = mesh.parameters.of("g_e").text();
  return parameters;
}

// The members that one of the objects has otherwise than the other, or not at all.
template <class Say>
void compare_members(const nlohmann::json& earlier, const nlohmann::json& now, const Say& say) {
  const nlohmann::json none;
  for (const auto& [name, value] : earlier.items()) {
    const nlohmann::json& other = now.contains(name) ? now[name] : none;
    if (other != value) say(name, value, other);
  }
  for (const auto& [name, value] : now.items()) {
    if (!earlier.contains(name)) say(name, none, value);
  }
}

void compare_inputs(const nlohmann::json& earlier, const nlohmann::json& now,
                    std::vector<std::string>& differences) {
  const auto names = [](const nlohmann::json& inputs) {
    std::string text;
    for (const nlohmann::json& input : inputs)
      text += (text.empty() ? "" : ", ") + input.at("name").dump();
    return text;
  };
  if (names(earlier) != names(now)) {
    differences.push_back(
        fmt::format("the inputs were {}, and are {} now", names(earlier), names(now)));
    return;
  }
  for (std::size_t k = 0; k < now.size(); ++k) {
    compare_members(earlier.at(k).at("files"), now.at(k).at("files"),
                    [&differences](const std::string& name, const nlohmann::json& was,
                                   const nlohmann::json& is) {
                      const char* what = was.is_null()  ? "was not there before"
                                         : is.is_null() ? "is gone"
                                                        : "has changed (its size or time)";
                      differences.push_back(fmt::format("the input's file {} {}", name, what));
                    });
  }
}

// What layer.json says of the set besides.
nlohmann::json texts_of(const OutputOptions& output) {
  return {{"--name", output.name},
          {"--description", output.description},
          {"--attribution", output.attribution}};
}

void compare_versions(const nlohmann::json& was, const nlohmann::json& is,
                      std::vector<std::string>& differences) {
  if (was.at("program_version") == is.at("program_version")) return;
  differences.push_back(fmt::format("it was begun by version {} of the program, and this is {}",
                                    was.at("program_version").dump(),
                                    is.at("program_version").dump()));
}

void compare_values(const nlohmann::json& was, const nlohmann::json& is,
                    std::vector<std::string>& differences) {
  compare_members(was, is,
                  [&differences](const std::string& name, const nlohmann::json& before,
                                 const nlohmann::json& after) {
                    differences.push_back(
                        fmt::format("{} was {}, and is {} now", name, before.dump(), after.dump()));
                  });
}

// What a text that was kept and the one of now differ in; `foreign` where the kept one is none of ours.
// `compare_own` has what only one kind of text holds between its version and its values.
template <class CompareOwn>
std::vector<std::string> differences_between(const std::string& earlier, const std::string& now,
                                             const char* foreign,
                                             const CompareOwn& compare_own) try {
  if (earlier == now) return {};
  const nlohmann::json was = nlohmann::json::parse(earlier);
  const nlohmann::json is = nlohmann::json::parse(now);
  std::vector<std::string> differences;
  compare_versions(was, is, differences);
  compare_own(was, is, differences);
  compare_values(was.at("parameters"), is.at("parameters"), differences);
  // Only a finished set's has them.
  if (is.contains("texts")) compare_values(was.at("texts"), is.at("texts"), differences);
  return differences;
} catch (const nlohmann::json::exception&) {
  return {foreign};
}

}  // namespace

std::string provenance_of(const BuildOptions& options) {
  const nlohmann::json provenance = {{"program_version", kProgramVersion},
                                     {"inputs_hash", hash_text(inputs_of(options.input).dump())},
                                     {"parameters", parameters_of(options)},
                                     {"texts", texts_of(options.output)}};
  return provenance.dump();
}

std::vector<std::string> provenance_differences(const std::string& earlier,
                                                const std::string& now) {
  return differences_between(
      earlier, now, "its report was written by another program",
      [](const nlohmann::json& was, const nlohmann::json& is,
         std::vector<std::string>& differences) {
        if (was.at("inputs_hash") == is.at("inputs_hash")) return;
        differences.emplace_back("the inputs were others, or have changed (their sizes or times)");
      });
}

std::string fingerprint_of(const BuildOptions& options) {
  const nlohmann::json fingerprint = {{"program_version", kProgramVersion},
                                      {"inputs", inputs_of(options.input)},
                                      {"parameters", parameters_of(options)}};
  return fingerprint.dump();
}

std::vector<std::string> fingerprint_differences(const std::string& earlier,
                                                 const std::string& now) {
  return differences_between(earlier, now, "the journal was written by another program",
                             [](const nlohmann::json& was, const nlohmann::json& is,
                                std::vector<std::string>& differences) {
                               compare_inputs(was.at("inputs"), is.at("inputs"), differences);
                             });
}

}  // namespace qmpipe
