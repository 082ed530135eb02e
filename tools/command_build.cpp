#include "tools/command_build.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cstdio>
#include <memory>
#include <thread>

#include "formats/errors.h"
#include "pipeline/build.h"
#include "tools/interrupt.h"
#include "tools/method_arguments.h"
#include "tools/parse_values.h"

namespace qmpipe {
namespace {

// The words as typed, before they are understood.
struct BuildArguments {
  BuildOptions options;
  std::string scheme = "geodetic";
  MethodArguments method;
  std::string resampling = name_of(Resampling::kBilinear);
  std::string reduction = name_of(Reduction::kMean);
  std::string voids = "pull";
  std::string gzip = "7";
  std::string memory = "0";
  double tolerance_m = 0;
  bool tolerance_given = false;
  double grid_cells = 0;
  bool grid_given = false;
  std::string tolerances;
  std::int32_t max_zoom = -1;
  bool no_normals = false;
  bool overwrite = false;
  bool json = false;
  bool verbose = false;
};

template <class Value>
Value understood(const char* option, const Result<Value>& value) {
  if (!value) throw UsageError(std::string(option) + ": " + value.error().message);
  return *value;
}

MethodChoice to_method(const BuildArguments& arguments) {
  ShortForms short_forms;
  if (arguments.tolerance_given) {
    short_forms.emplace_back("g_e", ZoomSeries({arguments.tolerance_m}, 0.5));
  }
  if (arguments.grid_given) short_forms.emplace_back("g_g", ZoomSeries({arguments.grid_cells}));
  return to_choice(arguments.method, short_forms);
}

BuildOptions to_options(const BuildArguments& arguments) {
  BuildOptions options = arguments.options;
  options.mesh.projection =
      arguments.scheme == "mercator" ? Projection::kMercator : Projection::kGeodetic;
  const MethodChoice method = to_method(arguments);
  options.mesh.method = method.method;
  options.mesh.stop = method.stop;
  options.mesh.parameters = method.parameters;
  options.input.resampling = understood("--resampling", resampling_named(arguments.resampling));
  options.mesh.reduction = understood("--reduce", reduction_named(arguments.reduction));
  options.mesh.voids = understood("--nodata", void_policy_named(arguments.voids));
  options.mesh.tolerance_at_m = parse_tolerances(arguments.tolerances);
  if (arguments.max_zoom >= 0) options.mesh.max_zoom = arguments.max_zoom;
  options.encode.gzip_level = parse_gzip(arguments.gzip);
  options.encode.normals = !arguments.no_normals;
  options.run.memory_bytes = parse_size("--memory", arguments.memory);
  options.output.overwrite = arguments.overwrite ? Overwrite::kYes : Overwrite::kNo;
  return options;
}

void print_effective(const BuildOptions& options) {
  const MeshOptions& mesh = options.mesh;
  const MethodChoice choice = {mesh.method, mesh.stop, mesh.parameters};
  std::string text = "effective options:\n";
  for (const std::string& path : options.input.paths) text += "  input          " + path + "\n";
  text += fmt::format(
      "  output         {}\n  scheme         {}\n  zooms          {}..{}\n  method         {}\n",
      options.output.path.string(),
      mesh.projection == Projection::kGeodetic ? "geodetic" : "mercator", mesh.min_zoom,
      mesh.max_zoom ? std::to_string(*mesh.max_zoom) : "(from the pixels)", text_of(choice));
  text += effective_parameters(choice);
  for (const auto& [zoom, metres] : mesh.tolerance_at_m) {
    text += fmt::format("  tolerance-at   {}={} m\n", zoom, metres);
  }
  text += fmt::format(
      "  resampling     {}\n  reduce         {}\n  nodata         {}\n"
      "  normals        {}\n  gzip           {}\n  threads        {}\n  memory         {}\n"
      "  checkpoint     {} s\n",
      name_of(options.input.resampling), name_of(mesh.reduction), name_of(mesh.voids),
      options.encode.normals ? "yes" : "no",
      options.encode.gzip_level ? std::to_string(*options.encode.gzip_level) : "none",
      options.run.threads,
      options.run.memory_bytes == 0 ? "nine tenths of the machine's"
                                    : bytes_text(options.run.memory_bytes),
      options.run.checkpoint_s);
  std::fputs(text.c_str(), stderr);
}

int run_build(const BuildArguments& arguments) {
  const BuildOptions options = to_options(arguments);
  if (arguments.verbose) print_effective(options);
  ProgressStyle style =
      isatty(STDERR_FILENO) != 0 ? ProgressStyle::kTerminal : ProgressStyle::kSilent;
  if (arguments.json) style = ProgressStyle::kJsonLines;
  Progress progress(style, stop_flag_of_signals());
  const BuildResult result = build_pyramid(options, progress);
  std::string text;
  if (options.run.dry_run) {
    text = arguments.json ? estimate_json(result.estimate) + "\n" : estimate_text(result.estimate);
  } else if (arguments.json) {
    text = write_report(result.report);
  } else {
    text = report_table(result.report) +
           fmt::format(
               "source: {}\n"
               "built: {} tiles, {} in {} (survey {:.1f} s, mesh {:.1f} s, peak memory {})\n",
               source_reads_text(result.report.source_reads), result.report.tiles,
               bytes_text(result.report.stored_bytes), options.output.path.string(),
               result.report.survey_s, result.report.mesh_s,
               bytes_text(result.report.peak_resident_bytes));
  }
  std::fputs(text.c_str(), stdout);
  return 0;
}

void add_input_options(CLI::App& command, BuildArguments& arguments) {
  command
      .add_option("INPUT", arguments.options.input.paths,
                  "Rasters of any GDAL format and CRS; where they overlap, the first that is valid "
                  "wins")
      ->required();
  command
      .add_option("--source-crs", arguments.options.input.source_crs,
                  "CRS of the inputs, in place of their own (EPSG:32605, a .prj file, WKT)")
      ->type_name("CRS");
  command
      .add_option("--resampling", arguments.resampling,
                  "How a post is read between pixels: bilinear, cubic or nearest")
      ->capture_default_str()
      ->check(CLI::IsMember({"bilinear", "cubic", "nearest"}));
  command
      .add_option("--reduce", arguments.reduction,
                  "How a coarser zoom is made: mean, subsample, max (shoal-biased) or min")
      ->capture_default_str()
      ->check(CLI::IsMember({"mean", "subsample", "max", "min"}));
  command
      .add_option(
          "--nodata", arguments.voids,
          "What fills voids: pull (from the coarser zooms, fading to 0 m some 64 posts from "
          "the data) or height=H in metres")
      ->capture_default_str();
}

void add_mesh_options(CLI::App& command, BuildArguments& arguments) {
  MeshOptions& mesh = arguments.options.mesh;
  command
      .add_option("--scheme", arguments.scheme,
                  "Tiling scheme: geodetic (EPSG:4326) or mercator (EPSG:3857)")
      ->capture_default_str()
      ->check(CLI::IsMember({"geodetic", "mercator"}));
  command.add_option("--min-zoom", mesh.min_zoom, "Coarsest zoom (above 0: a set without roots)")
      ->capture_default_str();
  command
      .add_option("--max-zoom", arguments.max_zoom,
                  "Deepest zoom (default: the coarsest whose posts are no wider apart than pixels)")
      ->check(CLI::NonNegativeNumber);
  command
      .add_option(
          "--tolerance", arguments.tolerance_m,
          "Largest vertical error at zoom 0 in metres; halved at each deeper zoom "
          "[15000]. For greedy and for edge-collapse with --stop tolerance; with the others it "
          "sets how fine heights are")
      ->type_name("M");
  command
      .add_option("--tolerance-at", arguments.tolerances,
                  "Zooms with a tolerance of their own: zoom=metres, separated by commas")
      ->type_name("Z=M,...");
  command.add_option("--grid", arguments.grid_cells, "The same as --param g_g=N")->type_name("N");
  add_method_options(command, arguments.method);
}

void add_output_options(CLI::App& command, BuildArguments& arguments) {
  BuildOptions& options = arguments.options;
  command.add_option("-o,--output", options.output.path, "Folder for the tiles")->type_name("OUT");
  command.add_flag("--overwrite", arguments.overwrite,
                   "Replace an earlier tile set in OUT; start an unfinished one over");
  command
      .add_option("--gzip", arguments.gzip,
                  "Gzip level 1 (fast) .. 12 (small), or none: plain tiles need no "
                  "Content-Encoding header")
      ->capture_default_str()
      ->type_name("LEVEL|none");
  command.add_flag("--no-normals", arguments.no_normals, "Leave out the vertex normals");
  command.add_option("--name", options.output.name, "Name in layer.json (default: OUT's)");
  command.add_option("--description", options.output.description, "Description in layer.json");
  command.add_option("--attribution", options.output.attribution,
                     "Attribution in layer.json; viewers show it");
  command.add_option("--threads", options.run.threads, "Threads to work with (default: all cores)");
  command
      .add_option("--memory", arguments.memory,
                  "Most memory for the whole process, such as 512M or 2G; 0: nine tenths of the "
                  "machine's")
      ->capture_default_str()
      ->type_name("SIZE");
  command
      .add_option("--checkpoint", options.run.checkpoint_s,
                  "Seconds between two checkpoints: what a crash may cost; 0: none, an interrupted "
                  "run starts again")
      ->capture_default_str()
      ->type_name("S");
  command
      .add_option("--run-folder", options.output.run_folder,
                  "Folder for checkpoints and stores while the run lasts (default: OUT.qmpipe-run)")
      ->type_name("DIR");
  command.add_flag("--keep-run", options.run.keep_run,
                   "Leave the run folder with its stores when the tiles are done");
  command.add_flag("--dry-run", options.run.dry_run,
                   "Stop after the estimate: tiles, size, time, memory");
  command.add_flag("--json", arguments.json,
                   "Report as JSON on stdout, progress as JSON lines on stderr");
  command.add_flag("-v,--verbose", arguments.verbose, "Print every effective option first");
}

}  // namespace

void register_build(CLI::App& app, std::function<int()>& action) {
  auto arguments = std::make_shared<BuildArguments>();
  arguments->options.run.threads =
      static_cast<std::int32_t>(std::max(1U, std::thread::hardware_concurrency()));
  CLI::App* command = app.add_subcommand(
      "build", "Turn rasters into a quantized-mesh terrain pyramid (folder with layer.json)");
  add_input_options(*command, *arguments);
  add_mesh_options(*command, *arguments);
  add_output_options(*command, *arguments);
  command->footer(
      "Example:\n"
      "  qmpipe build dem.tif -o tiles --attribution \"(c) Survey Office\"\n"
      "  qmpipe build fine.tif coarse.tif -o tiles --max-zoom 12 --tolerance-at 12=2 --memory 2G\n"
      "A run that was stopped, killed or failed goes on where it was: give the same command "
      "again.\n"
      "Exit codes: 0 built, 1 failed, 2 wrong usage, 130 interrupted (checkpoint kept).");
  command->callback([arguments, command, &action] {
    arguments->tolerance_given = command->count("--tolerance") > 0;
    arguments->grid_given = command->count("--grid") > 0;
    action = [arguments] { return run_build(*arguments); };
  });
}

}  // namespace qmpipe
