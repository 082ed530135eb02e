#include "pipeline/build.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <chrono>
#include <optional>
#include <set>

#include "formats/errors.h"
#include "formats/file_bytes.h"
#include "formats/folder_sink.h"
#include "pipeline/build_plan.h"
#include "pipeline/memory_share.h"
#include "pipeline/run_folder.h"
#include "pipeline/survey.h"
#include "pipeline/tile_graph.h"
#include "pipeline/version.h"

namespace qmpipe {
namespace {

void require_sound(const BuildOptions& options) {
  const std::vector<std::string> rules = violated_rules(options);
  if (rules.empty()) return;
  std::string text = "the options cannot be used:";
  for (const std::string& rule : rules) text += "\n  " + rule;
  throw UsageError(text);
}

SurveyOptions survey_options(const BuildOptions& options) {
  return {.inputs = options.input.paths,
          .source_crs = options.input.source_crs,
          .resampling = options.input.resampling,
          .reduction = options.mesh.reduction,
          .scheme = TilingScheme(options.mesh.projection),
          .sampling_zoom = -1,
          .max_zoom = options.mesh.max_zoom.value_or(-1),
          .threads = options.run.threads};
}

// Tells what the sources leave open, so that a wrong guess does not go unnoticed.
void note_assumptions(const std::vector<RasterInfo>& sources, Progress& progress) {
  bool any_datum = true;
  std::set<std::string> said;
  for (const RasterInfo& source : sources) {
    for (const std::string& assumption : source.assumptions) {
      if (said.insert(assumption).second) progress.note(source.path + ": " + assumption);
    }
    any_datum = any_datum && source.has_vertical_datum;
  }
  if (!any_datum) {
    progress.note(
        "heights are written as they are: the input names no vertical datum, so they are taken as "
        "heights above the WGS84 ellipsoid (heights above sea level will stand off by the geoid's "
        "height, up to 100 m)");
  }
}

void require_data(const Survey& survey) {
  if (!survey.tiles.front().empty()) return;
  std::string names;
  for (const RasterInfo& source : survey.sources) {
    names += (names.empty() ? "" : ", ") + source.path;
  }
  throw IoError("no valid post in", names,
                "every pixel is void or the rasters lie between the posts",
                "check the declared void value with gdalinfo -stats");
}

RectangleDeg united_bounds(const std::vector<RasterInfo>& sources) {
  RectangleDeg box = sources.front().bounds_deg;
  for (const RasterInfo& source : sources) {
    box.west_deg = std::min(box.west_deg, source.bounds_deg.west_deg);
    box.south_deg = std::min(box.south_deg, source.bounds_deg.south_deg);
    box.east_deg = std::max(box.east_deg, source.bounds_deg.east_deg);
    box.north_deg = std::max(box.north_deg, source.bounds_deg.north_deg);
  }
  // Across the antimeridian there is no west < east: the whole circle is the honest answer.
  if (box.east_deg > 180 || box.west_deg < -180) {
    box.west_deg = -180;
    box.east_deg = 180;
  }
  box.south_deg = std::max(box.south_deg, -90.0);
  box.north_deg = std::min(box.north_deg, 90.0);
  return box;
}

LayerJson layer_for(const BuildOptions& options, const Survey& survey, const BuildPlan& plan,
                    const BuildReport& report) {
  LayerJson layer;
  layer.name =
      options.output.name.empty() ? options.output.path.filename().string() : options.output.name;
  layer.description = options.output.description;
  layer.attribution = options.output.attribution;
  // Clients cache by version, so it changes when, and only when, a tile does.
  layer.version = fmt::format("1.0.0-{:016x}", report.content_hash);
  layer.projection = options.mesh.projection;
  if (options.encode.normals) layer.extensions = {"octvertexnormals"};
  layer.min_zoom = plan.recipe.min_zoom;
  layer.max_zoom = plan.recipe.max_zoom;
  layer.bounds_deg = united_bounds(survey.sources);
  for (const auto& keys : plan.keys) layer.available.push_back(merge_ranges(keys));
  layer.qmpipe_json = write_recipe(plan.recipe);
  return layer;
}

BuildReport empty_report(const BuildOptions& options, const BuildPlan& plan,
                         const MemoryPlan& memory) {
  BuildReport report;
  report.threads = options.run.threads;
  report.max_in_flight = memory.max_in_flight;
  report.expected_peak_bytes = memory.expected_peak_bytes;
  for (std::int32_t zoom = plan.recipe.min_zoom; zoom <= plan.recipe.max_zoom; ++zoom) {
    const auto at = static_cast<std::size_t>(zoom);
    BuiltZoom& row = report.zooms.emplace_back();
    row.zoom = zoom;
    row.tolerance_m = plan.recipe.tolerance_m[at];
    row.height_step_m = plan.recipe.height_step_m[at];
  }
  return report;
}

BuildReport mesh_pass(const BuildOptions& options, const BuildPlan& plan,
                      const Heightfield& heightfield, const MemoryPlan& memory, TileSink& sink,
                      Progress& progress) {
  BuildReport report = empty_report(options, plan, memory);
  const auto started = std::chrono::steady_clock::now();
  const std::unique_ptr<BorderStore> borders = make_memory_border_store();
  const TileGraphResult result =
      run_tile_graph(plan, heightfield, *borders, sink,
                     {.threads = options.run.threads,
                      .max_in_flight = memory.max_in_flight,
                      .gzip_level = options.encode.gzip_level},
                     progress, [&report](const TileWork& work) { report.add(work); });
  if (result.stopped) {
    throw Interrupted(
        fmt::format("stopped after {} of {} tiles; {} holds no finished tile set (build again with "
                    "--overwrite)",
                    result.tiles_done, plan.tile_count(), options.output.path.string()));
  }
  QMPIPE_CHECK(borders->size() == 0);
  report.largest_in_flight = result.largest_in_flight;
  report.mesh_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count();
  return report;
}

}  // namespace

BuildResult build_pyramid(const BuildOptions& options, Progress& progress) {
  require_sound(options);
  const tbb::global_control workers(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.run.threads));
  SurveyOptions to_survey = survey_options(options);
  const std::vector<RasterInfo> sources = describe_inputs(to_survey);
  note_assumptions(sources, progress);
  const MemoryShare share = share_memory(options.run.memory_bytes, to_survey, sources);
  const MemoryPlan& memory = share.plan;
  set_raster_cache_bytes(memory.raster_cache_bytes);
  to_survey.threads = memory.sampling_threads;
  // Opened before hours of work, so that a folder that cannot be used is known at once.
  std::unique_ptr<TileSink> sink;
  if (!options.run.dry_run) sink = open_folder_sink(options.output.path, options.output.overwrite);

  // Outlives the survey's store, which lies in it.
  std::optional<RunFolder> run_folder;
  if (share.store_bytes > 0) {
    run_folder.emplace(options.output.path);
    to_survey.store_folder = run_folder->path();
    to_survey.last_memory_zoom = share.last_memory_zoom;
    progress.note(fmt::format("the lattice of the zooms below {} is kept in {}: at most {} of disk",
                              share.last_memory_zoom, run_folder->path().string(),
                              bytes_text(share.store_bytes)));
  }
  const Survey survey = run_survey(to_survey, progress);
  require_data(survey);
  const BuildPlan plan = plan_build(options, survey);
  const Heightfield heightfield(*survey.store, survey.scheme, options.mesh.voids,
                                survey.pole_heights);
  BuildResult result;
  result.estimate = estimate_build(options, plan, heightfield, memory);
  progress.event(estimate_json(result.estimate));
  if (options.run.dry_run) return result;
  progress.note(fmt::format("{} tiles, about {} and {:.0f} s, memory at most {}",
                            result.estimate.tiles, bytes_text(result.estimate.bytes),
                            std::max(1.0, result.estimate.seconds),
                            bytes_text(result.estimate.expected_peak_bytes)));

  result.report = mesh_pass(options, plan, heightfield, memory, *sink, progress);
  result.report.survey_s = survey.seconds;
  result.report.peak_resident_bytes = peak_resident_bytes();
  const std::string text = write_report(result.report);
  write_file_atomically(options.output.path / "report.json",
                        {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  sink->close(layer_for(options, survey, plan, result.report));
  return result;
}

}  // namespace qmpipe
