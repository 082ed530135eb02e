// The options that choose a simplification method, the same for every command that has one.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "pipeline/recipe/method.h"

namespace CLI {
class App;
}

namespace qmpipe {

// The words as typed, before they are understood.
struct MethodArguments {
  std::string method = name_of(Method::kGreedy);
  std::string stop = name_of(Stop::kTolerance);
  std::string parameter_file;
  std::vector<std::string> parameters;  // NAME=VALUE
};

// --method, --stop, --param and --params.
void add_method_options(CLI::App& command, MethodArguments& arguments);

// "g_e=15000/2"
std::pair<std::string, ZoomSeries> parse_parameter(const std::string& text);

struct MethodChoice {
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
  MethodParameters parameters;
};

// Flags win over the file, the file over `defaults`; `short_forms` are what other options of the
// command say about parameters, and count as flags. Throws UsageError for what cannot be
// understood, and for --param with a parameter that the method does not have (a file may list those of
// all methods).
struct ShortForm {
  const char* option;  // "--tolerance"
  std::string parameter;
  ZoomSeries series;
};
using ShortForms = std::vector<ShortForm>;
void set_parameter(const ShortForm& form, MethodParameters& parameters);
MethodChoice to_choice(const MethodArguments& arguments, const ShortForms& short_forms,
                       const MethodParameters& defaults = {});

// "greedy", "edge-collapse by edges": how a choice is called in texts.
std::string text_of(const MethodChoice& choice);

// One line for each parameter that counts: its value and meaning.
std::string effective_parameters(const MethodChoice& choice);

}  // namespace qmpipe
