#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <nlohmann/json.hpp>

#include "formats/bytes/errors.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/printable.h"
#include "formats/detail_model/file.h"
#include "pipeline/common/machine_share.h"
#include "pipeline/common/process_memory.h"
#include "pipeline/detail_model/build.h"
#include "tools/arguments/heights.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/number_options.h"
#include "tools/arguments/terminal.h"
#include "tools/commands/detail_commands.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

constexpr const char* kDetailBuildFooter =
    "The terrain is cut into blocks by the middles of x and y, each is triangulated and then\n"
    "simplified by quadric errors down to --keep of its triangles, and every step is kept. The\n"
    "model is the same on any number of threads. An existing FILE is replaced.\n"
    "\n"
    "Examples:\n"
    "  qmpipe detail build dem.tif -o terrain.h5\n"
    "  qmpipe detail build survey.las -o terrain.h5 --class ground --thin 0.5\n"
    "  qmpipe detail build dem.tif -o terrain.h5 --blocks 64 --keep 5% --interval 1000\n"
    "Exit codes: 0 written, 1 failed, 2 wrong usage, 130 interrupted.";

struct DetailBuildArguments {
  DetailBuildOptions options;
  HeightArguments heights;
  std::string output;
  std::string keep = "20%";
  std::string classes;
  bool wants_json = false;
};

double parse_keep(const std::string& text) {
  const bool is_percent = text.ends_with('%');
  try {
    std::size_t used = 0;
    const double value = std::stod(text, &used);
    if (used == text.size() - (is_percent ? 1 : 0)) return is_percent ? value / 100 : value;
  } catch (const std::logic_error&) {
    // Not a number: said below.
  }
  throw UsageError(fmt::format("--keep {}: give a share, as 20% or 0.2", text));
}

void print_text(const DetailBuildArguments& arguments, const DetailBuilt& built,
                std::uintmax_t file_bytes) {
  const DetailBuildReport& report = built.report;
  const auto line = [](const char* name, const std::string& value) {
    fmt::print("{:<12}{}\n", name, value);
  };
  line("model",
       fmt::format("{}, {} bytes, {:.2f} a triangle of the finest mesh",
                   printable_line(arguments.output), file_bytes,
                   static_cast<double>(file_bytes) /
                       static_cast<double>(std::max<std::int64_t>(1, report.finest_triangles))));
  line("points", fmt::format("{}, {} left out{}", report.points, report.left_out,
                             report.left_out_text.empty() ? "" : ": " + report.left_out_text));
  line("triangles",
       fmt::format("{} at the finest level, {} at the coarsest, {} of them in seams",
                   report.finest_triangles, report.coarsest_triangles, report.seam_triangles));
  line("levels", fmt::format("{} in {} blocks", report.collapses, built.model.blocks.size()));
  line("time", fmt::format("reading {:.2f} s, triangulating {:.2f} s, simplifying {:.2f} s",
                           report.read_s, report.triangulate_s, report.simplify_s));
  line("peak memory", fmt::format("{} bytes", peak_resident_bytes()));
}

void print_json(const DetailBuildArguments& arguments, const DetailBuilt& built,
                std::uintmax_t file_bytes) {
  const DetailBuildReport& report = built.report;
  const Json document = {{"model", arguments.output},
                         {"file_bytes", file_bytes},
                         {"points", report.points},
                         {"left_out", report.left_out},
                         {"finest_triangles", report.finest_triangles},
                         {"coarsest_triangles", report.coarsest_triangles},
                         {"seam_triangles", report.seam_triangles},
                         {"levels", report.collapses},
                         {"blocks", built.model.blocks.size()},
                         {"seconds",
                          {{"read", report.read_s},
                           {"triangulate", report.triangulate_s},
                           {"simplify", report.simplify_s}}},
                         {"peak_memory_bytes", peak_resident_bytes()}};
  fmt::print("{}\n", document.dump(2));
}

int run_build(DetailBuildArguments arguments) {
  arguments.options.keep_share = parse_keep(arguments.keep);
  if (!arguments.classes.empty()) {
    arguments.options.points.classes = parse_point_classes(arguments.classes);
  }
  arguments.options.heights = to_height_options(arguments.heights);
  arguments.options.guard = to_height_guard(arguments.heights);
  require_folder_of(arguments.output, "cannot write the model");
  Progress progress(progress_style(false), stop_flag_of_signals());
  const DetailBuilt built = build_detail(arguments.options, progress);
  write_detail_file(arguments.output, built.model);
  const std::uintmax_t file_bytes = fs::file_size(arguments.output);
  if (arguments.wants_json) {
    print_json(arguments, built, file_bytes);
  } else {
    print_text(arguments, built, file_bytes);
  }
  return 0;
}

}  // namespace

void register_detail_build(CLI::App& detail, std::function<int()>& action) {
  const auto arguments = std::make_shared<DetailBuildArguments>();
  DetailBuildOptions& options = arguments->options;
  options.threads = usable_threads();
  CLI::App* command =
      detail.add_subcommand("build", "Turn points or a DEM into a detail-increment model");
  command->footer(kDetailBuildFooter);
  begin_group(*command, kPapersGroup);
  command
      ->add_option(
          "INPUT", options.input,
          "Points as LAS 1.0 to 1.4 (.las) or text (.xyz, .csv, .txt: x, y and z in a line), or "
          "a raster of any GDAL format, 2 x 2 to 32768 x 32768 pixels")
      ->required();
  command->add_option("-o,--output", arguments->output, "Model to write (HDF5)")
      ->required()
      ->type_name("FILE");
  command
      ->add_option("--keep", arguments->keep,
                   "Share of each block's triangles that its coarsest level has")
      ->capture_default_str()
      ->type_name("SHARE");
  command
      ->add_option("--blocks", options.blocks,
                   "Blocks, which have levels of their own: 4 are two by two")
      ->capture_default_str()
      ->type_name("N");
  command
      ->add_option("--interval", options.interval,
                   "Levels that an increment is merged over (detail info --increments)")
      ->capture_default_str()
      ->type_name("K");
  begin_group(*command, kQualityGroup);
  command
      ->add_option(
          "--height-step", options.height_step_m,
          "Heights are rounded to multiples of it, metres (default: 1 where all heights are "
          "whole metres, else 0.01)")
      ->type_name("M");
  begin_group(*command, kInputGroup);
  command
      ->add_option("--class", arguments->classes,
                   "Classes of a LAS file to keep: ground, or numbers between commas (default: all "
                   "but noise)")
      ->type_name("LIST");
  command
      ->add_option("--thin", options.points.thin_m,
                   "Keep one point of each square of so many metres, the one nearest to its centre "
                   "(points only; 0: all)")
      ->check(fault_of_negative)
      ->type_name("M");
  command
      ->add_option(
          "--outliers", options.points.outlier_m,
          "Leave out a point so many metres above or below all others around it (points only; "
          "0: none, for a mast or a sharp peak is such a point too)")
      ->check(fault_of_negative)
      ->type_name("M");
  command
      ->add_option("--source-crs", options.points.source_crs,
                   "Take this CRS instead of the one that the input names (EPSG:n, WKT, PROJ)")
      ->type_name("CRS");
  add_height_options(*command, arguments->heights);
  add_height_guard(*command, arguments->heights);
  begin_group(*command, kResourcesGroup);
  command->add_option("--threads", options.threads, "Threads, each with a block of its own")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command->add_flag("--json", arguments->wants_json, "Report as JSON");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_build(*arguments); }; });
}

}  // namespace qmpipe
