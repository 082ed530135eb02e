#include "tools/commands/compare.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <system_error>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/printable.h"
#include "pipeline/compare/compare.h"
#include "pipeline/compare/compare_page.h"
#include "pipeline/compare/compare_tables.h"
#include "tools/arguments/exit_codes.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/parse_values.h"
#include "tools/arguments/pyramid.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

constexpr const char* kCompareFooter =
    "Builds a pyramid with each method, verifies it, and measures every tile without voids "
    "against\n"
    "the posts it was made from. REPORT becomes a folder with\n"
    "  index.html        tables, charts and pictures in one file that opens anywhere\n"
    "  compare.json      all numbers\n"
    "  single_tile.csv   one tile alone: parameters, run time, vertices, triangles (Table 2)\n"
    "  zooms.csv         by zoom: vertices, triangles, distances, errors, bytes, time (Table 4)\n"
    "  run_times.csv     of whole pyramids (Table 5)\n"
    "  distances.csv     sorted Hausdorff distances of all tiles (Figure 8)\n"
    "Tables and figures are those of Campos et al. 2020; distances and errors are in metres.\n"
    "Parameters default to their Table 3, but g_g is 0 (--param g_g=10 for theirs), and\n"
    "edge-collapse:tolerance, which ends by the same tolerance as greedy, is beyond the paper.\n"
    "\n"
    "Exit codes: 0 done, 1 failed, 2 wrong usage, 3 a pyramid has faults, 130 interrupted.\n"
    "\n"
    "Example:\n"
    "  qmpipe compare dem.tif -o report --methods greedy,edge-collapse:tolerance,ps-hierarchy";

struct CompareArguments {
  PyramidArguments pyramid;
  std::vector<std::string> methods = {"greedy",
                                      "edge-collapse:edges",
                                      "edge-collapse:tolerance",
                                      "ps-random",
                                      "ps-grid",
                                      "ps-hierarchy",
                                      "ps-wlop"};
  std::vector<std::string> parameters;
  std::string parameter_file;
  std::filesystem::path report;
  bool overwrite = false;
  bool keep_tiles = false;
  bool wants_json = false;
};

void write_text(const std::filesystem::path& path, const std::string& text) {
  write_file_atomically(path, {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
}

void require_room(const CompareArguments& arguments) {
  if (arguments.report.empty()) throw UsageError("-o, --output: name the folder for the report");
  std::error_code code;
  const bool exists = std::filesystem::exists(arguments.report, code);
  if (!exists || arguments.overwrite) return;
  if (std::filesystem::is_directory(arguments.report, code) &&
      std::filesystem::is_empty(arguments.report, code)) {
    return;
  }
  throw UsageError(
      fmt::format("{} is there already: choose another -o, or --overwrite to replace the report",
                  arguments.report.string()));
}

CompareOptions to_options(const CompareArguments& arguments) {
  CompareOptions options;
  options.build = to_build_options(arguments.pyramid);
  // Tiles are measured and thrown away: an interrupted comparison starts again.
  options.build.run.checkpoint_s = 0;
  MethodParameters& parameters = options.build.mesh.parameters;
  if (!arguments.parameter_file.empty()) read_parameter_file(arguments.parameter_file, parameters);
  for (const ShortForm& form : short_forms(arguments.pyramid)) set_parameter(form, parameters);
  for (const std::string& text : arguments.parameters) {
    const auto [name, series] = parse_parameter(text);
    parameters.set(name, series);
  }
  for (const std::string& name : arguments.methods) {
    const ComparedChoice choice = understood("--methods", compared_choice_named(name));
    const bool twice =
        std::any_of(options.methods.begin(), options.methods.end(),
                    [&](const ComparedChoice& one) { return name_of(one) == name_of(choice); });
    if (twice) throw UsageError("--methods: " + name_of(choice) + " is listed twice");
    options.methods.push_back(choice);
  }
  options.folder = arguments.report / "tiles";
  return options;
}

void write_report_files(const CompareArguments& arguments, const Comparison& comparison) {
  write_text(arguments.report / "single_tile.csv", single_tile_csv(comparison));
  write_text(arguments.report / "zooms.csv", zooms_csv(comparison));
  write_text(arguments.report / "run_times.csv", run_times_csv(comparison));
  write_text(arguments.report / "distances.csv", distances_csv(comparison));
  write_text(arguments.report / "compare.json", comparison_json(comparison));
  write_text(arguments.report / "index.html", comparison_page(comparison));
}

int run_compare(const CompareArguments& arguments) {
  require_room(arguments);
  const CompareOptions options = to_options(arguments);
  Progress progress(progress_style(arguments.wants_json), stop_flag_of_signals());
  make_folders(options.folder);
  const Comparison comparison = compare_methods(options, progress);
  write_report_files(arguments, comparison);
  if (!arguments.keep_tiles) {
    std::error_code code;
    std::filesystem::remove_all(options.folder, code);
  }
  std::int64_t faults = 0;
  for (const ComparedMethod& method : comparison.methods) faults += method.verify.fault_count;
  const std::string text =
      arguments.wants_json
          ? comparison_json(comparison)
          : zooms_csv(comparison) + "\n" + run_times_csv(comparison) +
                fmt::format("\nreport: {}\n",
                            printable_line((arguments.report / "index.html").string()));
  std::fputs(text.c_str(), stdout);
  return faults == 0 ? 0 : kExitFaults;
}

}  // namespace

void register_compare(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<CompareArguments>();
  CLI::App* command = app.add_subcommand(
      "compare", "Build with several simplification methods and report how they compare");
  add_pyramid_options(*command, arguments->pyramid);
  begin_group(*command, kPapersGroup);
  command
      ->add_option("--methods", arguments->methods,
                   "Methods to compare, separated by commas; edge-collapse with :edges or "
                   ":tolerance, what ends it")
      ->delimiter(',')
      ->capture_default_str();
  command
      ->add_option("--param", arguments->parameters,
                   "A parameter of any of the methods, as in `qmpipe build`: NAME=VALUE")
      ->type_name("NAME=VALUE")
      ->allow_extra_args(false);
  command
      ->add_option("--params", arguments->parameter_file,
                   "JSON file of parameters, as in `qmpipe build`")
      ->type_name("FILE");
  begin_group(*command, kRequiredGroup);
  command->add_option("-o,--output", arguments->report, "Folder for the report")
      ->type_name("REPORT");
  begin_group(*command, kOutputGroup);
  command->add_flag("--overwrite", arguments->overwrite, "Replace an earlier report in REPORT");
  command->add_flag("--keep-tiles", arguments->keep_tiles,
                    "Leave the pyramids in REPORT/tiles, one folder for each method");
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json,
                    "All numbers as JSON on stdout, progress as JSON lines on stderr");
  command->footer(kCompareFooter);
  command->callback(
      [arguments, &action] { action = [arguments] { return run_compare(*arguments); }; });
}

}  // namespace qmpipe
