#include "tools/commands/verify.h"

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <string>

#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/common/machine_share.h"
#include "pipeline/run/progress.h"
#include "pipeline/verify/verify.h"
#include "tools/arguments/exit_codes.h"
#include "tools/arguments/heights.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/interrupt.h"
#include "tools/arguments/number_options.h"
#include "tools/arguments/terminal.h"

namespace qmpipe {
namespace {

constexpr const char* kVerifyFooter =
    "Checks every tile: that it can be read under the strictest reading of the format; that its\n"
    "triangles are counter-clockwise and cover the tile's square exactly once; corners and side\n"
    "lists; the header's height range, bounding sphere and horizon occlusion point; that CesiumJS\n"
    "draws it from wherever it is seen. Checks neighbours: the same border vertices, less than\n"
    "1 mm apart, with equal normals, across the antimeridian too. Checks layer.json against the\n"
    "files: each listed tile is there and each tile is listed, with its parents and the roots;\n"
    "extensions as listed.\n"
    "\n"
    "With --source, also the vertical distance between each zoom's posts and the decoded surface.\n"
    "Posts of a set made by qmpipe are recomputed as its build did, and must be within each\n"
    "zoom's tolerance; for another program's set the source is sampled bilinearly and the\n"
    "distances are only reported. Give the same inputs in the same order as to the build.\n"
    "--hausdorff adds the mean symmetric Hausdorff distance of Campos et al. 2020 (section 5.2)\n"
    "between each tile without voids and the triangulation of all its posts: from vertices and\n"
    "2000 random points of each to the other's surface (as the paper's numbers are), and between\n"
    "the points alone (as its text says).\n"
    "\n"
    "The table has, for each zoom: tiles; mean vertices (V) and triangles (T); bytes as stored;\n"
    "the largest crack in millimetres; then in metres the largest, mean and RMS vertical error\n"
    "against the zoom's posts, which are means of the source's except at the deepest zooms, and\n"
    "the tolerance. The tolerance bounds that error, a vertex judged where the file puts it: to\n"
    "1/32767 of the tile. In place: the largest error of the surface at the exact place of every\n"
    "post; more than the tolerance only on slopes steeper than that in half such a unit. Source:\n"
    "the largest and RMS error against the source's own posts, all those of the sampling zoom,\n"
    "averaged with nothing; only for sets made by qmpipe.\n"
    "\n"
    "Exit code 0: no fault; 1: the set or the source cannot be opened; 2: usage; 3: faults found;\n"
    "130: interrupted. Warnings do not count as faults.\n"
    "\n"
    "Examples:\n"
    "  qmpipe verify out\n"
    "  qmpipe verify out --source dem.tif --hausdorff --json > verify.json";

struct VerifyArguments {
  std::string path;
  verify::VerifyOptions options;
  HeightArguments heights;
  bool wants_hausdorff = false;
  bool wants_json = false;
};

int run_verify(VerifyArguments arguments) {
  if (arguments.wants_hausdorff) arguments.options.hausdorff = verify::HausdorffMode::kMeasured;
  arguments.options.heights = to_height_options(arguments.heights);
  Progress progress(progress_style(false), stop_flag_of_signals());
  const std::unique_ptr<TileSet> tile_set = open_tile_set(arguments.path);
  const verify::VerifyReport report = verify::verify_set(*tile_set, arguments.options, progress);
  const std::string text = arguments.wants_json ? json_of(report) : text_of(report);
  std::fwrite(text.data(), 1, text.size(), stdout);
  return report.fault_count == 0 ? 0 : kExitFaults;
}

}  // namespace

void register_verify(CLI::App& app, std::function<int()>& action) {
  const auto arguments = std::make_shared<VerifyArguments>();
  verify::VerifyOptions& options = arguments->options;
  options.threads = usable_threads();
  CLI::App* command = app.add_subcommand(
      "verify",
      "Check a finished tile set: tiles, cracks, layer.json, and heights against a source");
  command->footer(kVerifyFooter);
  begin_group(*command, kInputGroup);
  command
      ->add_option("OUT", arguments->path,
                   "The tile set: its folder, the layer.json in it, or an .mbtiles file")
      ->required();
  command
      ->add_option("--source", options.sources,
                   "DEMs that the set was made from, in order of priority")
      ->type_name("INPUT");
  command
      ->add_option("--source-crs", options.source_crs,
                   "Take this CRS instead of the one that the sources name (EPSG:n, WKT, PROJ)")
      ->type_name("CRS");
  add_height_options(*command, arguments->heights);
  begin_group(*command, kPapersGroup);
  command->add_flag("--hausdorff", arguments->wants_hausdorff,
                    "Measure the symmetric Hausdorff distance too (needs --source)");
  begin_group(*command, kResourcesGroup);
  command->add_option("--threads", options.threads, "Threads; the report does not depend on them")
      ->check(CLI::Range(1, 1024))
      ->capture_default_str();
  begin_group(*command, kMessagesGroup);
  command
      ->add_option("--max-faults", options.most_per_kind,
                   "Faults and warnings of each kind to show; all are counted")
      ->type_name("N")
      ->check(fault_of_negative)
      ->capture_default_str();
  command->add_flag("--json", arguments->wants_json, "Write one JSON object instead of a table");
  command->callback(
      [arguments, &action] { action = [arguments] { return run_verify(*arguments); }; });
}

}  // namespace qmpipe
