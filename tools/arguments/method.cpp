#include "tools/arguments/method.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>

#include "formats/bytes/errors.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/parse_values.h"

namespace qmpipe {
namespace {

void require_parameter(const MethodChoice& choice, const std::string& name,
                       const std::string& option) {
  std::string own;
  for (const ParameterInfo& info : parameters_of(choice.method, choice.stop)) {
    if (info.name == name) return;
    own += (own.empty() ? "" : ", ") + std::string(info.name);
  }
  throw UsageError(
      fmt::format("{}: {} has no parameter {}, but {}", option, text_of(choice), name, own));
}

void set_by_flag(const std::string& text, MethodChoice& choice) {
  const auto [name, series] = parse_parameter(text);
  choice.parameters.set(name, series);
  require_parameter(choice, name, "--param " + text);
}

}  // namespace

std::pair<std::string, ZoomSeries> parse_parameter(const std::string& text) {
  const auto equals = text.find('=');
  if (equals == std::string::npos) {
    throw UsageError("--param " + text + ": give NAME=VALUE, such as g_g=10 or p_e=1024/2");
  }
  return {text.substr(0, equals),
          understood(("--param " + text).c_str(), ZoomSeries::parse(text.substr(equals + 1)))};
}

void add_method_options(CLI::App& command, MethodArguments& arguments) {
  begin_group(command, kPapersGroup);
  std::string names;
  for (const Method method : kMethods) names += (names.empty() ? "" : ", ") + name_of(method);
  command.add_option("--method", arguments.method, "How vertices are chosen: " + names)
      ->capture_default_str();
  command
      .add_option("--stop", arguments.stop,
                  "What ends edge-collapse: tolerance (it then holds at every post) or edges (e_e)")
      ->capture_default_str();
  command
      .add_option("--param", arguments.parameters,
                  "A parameter of the method by its name in Campos et al. 2020: NAME=VALUE with a "
                  "number; 15000/2 or 3*2 to halve or double it at each deeper zoom; or "
                  "5000,5000,1000 for zoom 0, 1, 2 and deeper. May be given several times")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  command
      .add_option("--params", arguments.parameter_file,
                  "JSON file of parameters: {\"g_e\": \"15000/2\", \"e_e\": [5000, 1000]}")
      ->type_name("FILE");
}

void set_parameter(const ShortForm& form, MethodParameters& parameters) {
  try {
    parameters.set(form.parameter, form.series);
  } catch (const UsageError& error) {
    throw UsageError(std::string(form.option) + ": " + error.what());
  }
}

MethodChoice to_choice(const MethodArguments& arguments, const ShortForms& short_forms,
                       const MethodParameters& defaults) {
  MethodChoice choice;
  choice.parameters = defaults;
  choice.method = understood("--method", method_named(arguments.method));
  choice.stop = understood("--stop", stop_named(arguments.stop));
  if (choice.stop == Stop::kEdges && choice.method != Method::kEdgeCollapse) {
    throw UsageError("--stop edges is for --method edge-collapse only");
  }
  if (!arguments.parameter_file.empty()) {
    read_parameter_file(arguments.parameter_file, choice.parameters);
  }
  for (const ShortForm& form : short_forms) {
    set_parameter(form, choice.parameters);
    // g_e sets how fine heights are, whatever the method.
    if (form.parameter != "g_e") require_parameter(choice, form.parameter, form.option);
  }
  for (const std::string& text : arguments.parameters) set_by_flag(text, choice);
  return choice;
}

std::string text_of(const MethodChoice& choice) {
  return name_of(choice.method) + (choice.stop == Stop::kEdges ? " by edges" : "");
}

std::string effective_parameters(const MethodChoice& choice) {
  std::string text;
  for (const ParameterInfo& info : parameters_of(choice.method, choice.stop)) {
    text += fmt::format("  {:<14} {} ({})\n", info.name, choice.parameters.of(info.name).text(),
                        info.meaning);
  }
  return text;
}

}  // namespace qmpipe
