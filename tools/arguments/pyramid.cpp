#include "tools/arguments/pyramid.h"

#include <CLI/CLI.hpp>

#include "formats/bytes/errors.h"
#include "pipeline/common/machine_share.h"
#include "tools/arguments/help_format.h"
#include "tools/arguments/parse_values.h"

namespace qmpipe {
namespace {

void add_input_options(CLI::App& command, PyramidArguments& arguments) {
  begin_group(command, kInputGroup);
  command
      .add_option("INPUT", arguments.options.input.paths,
                  "Rasters of any GDAL format and CRS; where they overlap, the first that is valid "
                  "wins")
      ->required();
  command
      .add_option("--source-crs", arguments.options.input.source_crs,
                  "CRS of the inputs, in place of their own (EPSG:32605, a .prj file, WKT)")
      ->type_name("CRS");
  add_height_options(command, arguments.heights);
  add_height_guard(command, arguments.heights);
  command
      .add_option(
          "--nodata", arguments.voids,
          "The ground where there are no data: pull (one surface for all zooms, fading to 0 m over "
          "about four times the height of the data's rim), pull=D (over D metres), height=H (H "
          "metres at once) or omit (as pull, without tiles that have a void, where the format "
          "allows)")
      ->capture_default_str();
  begin_group(command, kQualityGroup);
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
}

void add_mesh_options(CLI::App& command, PyramidArguments& arguments) {
  MeshOptions& mesh = arguments.options.mesh;
  begin_group(command, kOutputGroup);
  command
      .add_option("--scheme", arguments.scheme,
                  "Tiling scheme: geodetic (EPSG:4326) or mercator (EPSG:3857)")
      ->capture_default_str()
      ->check(CLI::IsMember({"geodetic", "mercator"}));
  begin_group(command, kQualityGroup);
  command.add_option("--min-zoom", mesh.min_zoom, "Coarsest zoom (above 0: a set without roots)")
      ->capture_default_str();
  command.add_option(
      "--max-zoom", arguments.max_zoom,
      "Deepest zoom of tiles (default: the coarsest whose posts are no wider apart than pixels). A "
      "smaller one does not make a run read or keep less: posts are taken at the default and "
      "reduced");
  command
      .add_option("--tolerance", arguments.tolerance_m,
                  "Largest vertical error at zoom 0 in metres; halved at each deeper zoom "
                  "(default: 15000). For greedy and for edge-collapse with --stop tolerance; with "
                  "the others it sets how fine heights are")
      ->type_name("M");
  command
      .add_option("--tolerance-at", arguments.tolerances,
                  "Zooms with a tolerance of their own: zoom=metres, separated by commas")
      ->type_name("Z=M,...");
  begin_group(command, kPapersGroup);
  command.add_option("--grid", arguments.grid_cells, "The same as --param g_g=N")->type_name("N");
}

void add_machine_options(CLI::App& command, PyramidArguments& arguments) {
  RunOptions& run = arguments.options.run;
  begin_group(command, kResourcesGroup);
  run.threads = usable_threads();
  command.add_option("--threads", run.threads,
                     "Threads to work with (default: all processors that it may use)");
  add_memory_option(command, arguments.memory);
}

}  // namespace

void add_memory_option(CLI::App& command, std::string& size) {
  begin_group(command, kResourcesGroup);
  command
      .add_option("--memory", size,
                  "Most memory for the whole process, such as 512M or 2G; 0: nine tenths of the "
                  "machine's")
      ->capture_default_str()
      ->type_name("SIZE");
}

void add_pyramid_options(CLI::App& command, PyramidArguments& arguments) {
  add_input_options(command, arguments);
  add_mesh_options(command, arguments);
  add_machine_options(command, arguments);
}

BuildOptions to_build_options(const PyramidArguments& arguments) {
  BuildOptions options = arguments.options;
  options.mesh.projection =
      arguments.scheme == "mercator" ? Projection::kMercator : Projection::kGeodetic;
  options.input.heights = to_height_options(arguments.heights);
  options.input.guard = to_height_guard(arguments.heights);
  options.input.resampling = understood("--resampling", resampling_named(arguments.resampling));
  options.mesh.reduction = understood("--reduce", reduction_named(arguments.reduction));
  options.mesh.voids = understood("--nodata", void_policy_named(arguments.voids));
  options.mesh.tolerance_at_m = parse_tolerances(arguments.tolerances);
  options.mesh.max_zoom = arguments.max_zoom;
  options.run.memory_bytes = parse_size("--memory", arguments.memory);
  return options;
}

ShortForms short_forms(const PyramidArguments& arguments) {
  ShortForms forms;
  if (arguments.tolerance_m) {
    forms.push_back({"--tolerance", "g_e", ZoomSeries({*arguments.tolerance_m}, 0.5)});
  }
  if (arguments.grid_cells) forms.push_back({"--grid", "g_g", ZoomSeries({*arguments.grid_cells})});
  return forms;
}

}  // namespace qmpipe
