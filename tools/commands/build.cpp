#include "tools/commands/build.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>

#include "formats/bytes/printable.h"
#include "pipeline/build/build.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/method.h"
#include "tools/arguments/parse_values.h"
#include "tools/arguments/pyramid.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

// The words as typed, before they are understood.
struct BuildArguments {
  PyramidArguments pyramid;
  MethodArguments method;
  EncodeOptions encode;
  OutputOptions output;
  double checkpoint_s = RunOptions().checkpoint_s;
  std::string gzip = "7";
  bool no_normals = false;
  bool overwrite = false;
  bool keep_run = false;
  bool dry_run = false;
  bool wants_json = false;
  bool verbose = false;
};

BuildOptions to_options(const BuildArguments& arguments) {
  BuildOptions options = to_build_options(arguments.pyramid);
  const MethodChoice method = to_choice(arguments.method, short_forms(arguments.pyramid));
  options.mesh.method = method.method;
  options.mesh.stop = method.stop;
  options.mesh.parameters = method.parameters;
  options.encode.gzip_level = parse_gzip(arguments.gzip);
  options.encode.normals = !arguments.no_normals;
  options.run.checkpoint_s = arguments.checkpoint_s;
  options.run.keep_run = arguments.keep_run;
  options.run.dry_run = arguments.dry_run;
  options.output = arguments.output;
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
  text += "  heights        " + heights_text(options.input.heights) + "\n";
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
  Progress progress({.style = progress_style(arguments.wants_json),
                     .stop = stop_flag_of_signals(),
                     .shows_buffers = arguments.verbose});
  const BuildResult result = build_pyramid(options, progress);
  std::string text;
  if (result.found) {
    text = arguments.wants_json
               ? result.found->report_json
               : fmt::format(
                     "built already: {} tiles in {}, from the same inputs and parameters "
                     "(--overwrite builds them again)\n",
                     result.found->tiles, options.output.path.string());
  } else if (options.run.dry_run) {
    text = arguments.wants_json ? estimate_json(result.estimate) + "\n"
                                : estimate_text(result.estimate);
  } else if (arguments.wants_json) {
    text = write_report(result.report);
  } else {
    text = report_table(result.report) +
           fmt::format(
               "source: {}\n"
               "built: {} tiles, {} in {} (survey {:.1f} s, mesh {:.1f} s, peak memory {})\n",
               source_reads_text(result.report.source_reads), result.report.tiles,
               bytes_text(result.report.stored_bytes), printable_line(options.output.path.string()),
               result.report.survey_s, result.report.mesh_s,
               bytes_text(result.report.peak_resident_bytes));
  }
  std::fputs(text.c_str(), stdout);
  return 0;
}

void add_output_options(CLI::App& command, BuildArguments& arguments) {
  OutputOptions& output = arguments.output;
  begin_group(command, kRequiredGroup);
  command
      .add_option("-o,--output", output.path,
                  "Folder for the tiles, or OUT.mbtiles: one file (not with --dry-run)")
      ->type_name("OUT");
  begin_group(command, kOutputGroup);
  command.add_flag("--overwrite", arguments.overwrite,
                   "Replace an earlier tile set in OUT; start an unfinished one over");
  command
      .add_option("--gzip", arguments.gzip,
                  "Gzip level 1 (fast) .. 12 (small), or none: plain tiles need no "
                  "Content-Encoding header")
      ->capture_default_str()
      ->type_name("LEVEL|none");
  command.add_flag("--no-normals", arguments.no_normals, "Leave out the vertex normals");
  command.add_option("--name", output.name, "Name in layer.json (default: OUT's)");
  command.add_option("--description", output.description, "Description in layer.json");
  command.add_option("--attribution", output.attribution,
                     "Attribution in layer.json; viewers show it");
  begin_group(command, kResourcesGroup);
  command
      .add_option(
          "--checkpoint", arguments.checkpoint_s,
          "Seconds between two checkpoints: what a crash may cost; a survey that took longer "
          "is kept when the run is stopped; 0: nothing is kept, an interrupted run starts "
          "again")
      ->capture_default_str()
      ->type_name("S");
  command
      .add_option("--run-folder", output.run_folder,
                  "Folder for checkpoints and stores while the run lasts (default: OUT.qmpipe-run)")
      ->type_name("DIR");
  command.add_flag("--keep-run", arguments.keep_run,
                   "Leave the run folder with its stores when the tiles are done");
  command.add_flag("--dry-run", arguments.dry_run,
                   "Stop after the estimate: tiles, size, time, memory");
  begin_group(command, kMessagesGroup);
  command.add_flag("--json", arguments.wants_json,
                   "Report as JSON on stdout, progress as JSON lines on stderr");
  command.add_flag("-v,--verbose", arguments.verbose,
                   "Print every effective option first, and how full each buffer is meanwhile");
}

}  // namespace

void register_build(CLI::App& app, std::function<int()>& action) {
  auto arguments = std::make_shared<BuildArguments>();
  CLI::App* command = app.add_subcommand(
      "build", "Turn rasters into a quantized-mesh terrain pyramid (folder or .mbtiles file)");
  add_pyramid_options(*command, arguments->pyramid);
  add_method_options(*command, arguments->method);
  add_output_options(*command, *arguments);
  command->footer(
      "Example:\n"
      "  qmpipe build dem.tif -o tiles --attribution \"(c) Survey Office\"\n"
      "  qmpipe build dem.tif -o alps.mbtiles\n"
      "  qmpipe build fine.tif coarse.tif -o tiles --max-zoom 12 --tolerance-at 12=2 --memory 2G\n"
      "A run that was stopped, killed or failed goes on where it was: give the same command "
      "again.\nGiven again when all is done, it says so and ends with 0.\n"
      "Exit codes: 0 built, 1 failed, 2 wrong usage, 130 interrupted (checkpoint kept).");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_build(*arguments); }; });
}

}  // namespace qmpipe
