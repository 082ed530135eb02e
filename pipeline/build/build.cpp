#include "pipeline/build/build.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <set>
#include <utility>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/tile/layer_json.h"
#include "formats/tile_sets/tile_output.h"
#include "pipeline/build/build_plan.h"
#include "pipeline/build/forecast.h"
#include "pipeline/build/mesh_pass.h"
#include "pipeline/common/process_memory.h"
#include "pipeline/common/scratch_folder.h"
#include "pipeline/common/version.h"
#include "pipeline/recipe/fingerprint.h"
#include "pipeline/run/run_record.h"
#include "pipeline/run/source_notes.h"
#include "pipeline/survey/block_cover.h"
#include "pipeline/survey/data_cover.h"
#include "pipeline/survey/keep_survey.h"
#include "pipeline/survey/memory_share.h"
#include "pipeline/survey/survey.h"

namespace qmpipe {
namespace {

void require_sound(const BuildOptions& options) {
  const std::vector<std::string> rules = violated_rules(options);
  if (rules.empty()) return;
  std::string text = "the options cannot be used:";
  for (const std::string& rule : rules) text += "\n  " + rule;
  throw UsageError(text);
}

// Before anything is made on disk: where nobody names the deepest zoom, the pixels decide it.
void require_a_zoom(const BuildOptions& options, std::int32_t deepest_zoom) {
  const std::int32_t min_zoom = options.mesh.min_zoom;
  if (min_zoom <= deepest_zoom) return;
  throw UsageError(fmt::format(
      "--min-zoom {} is deeper than the deepest zoom, which is {} for pixels of this size; give "
      "--min-zoom {} or less, or --max-zoom {} to interpolate between the pixels",
      min_zoom, deepest_zoom, deepest_zoom, min_zoom));
}

// Reducing is what makes coarse posts right, so a smaller --max-zoom does not spare it.
void note_sampling(const SurveyChoice& survey, const std::vector<RasterInfo>& sources,
                   Progress& progress) {
  const std::int32_t zoom = chosen_sampling_zoom(survey, sources);
  if (survey.max_zoom < 0 || survey.max_zoom >= zoom) return;
  const std::int64_t blocks = expected_blocks(survey.scheme, zoom, sources);
  progress.note(fmt::format(
      "tiles end at zoom {}, but posts are taken at zoom {}, where they are no wider apart than "
      "the pixels, and reduced: at most {} posts, {} while the run lasts",
      survey.max_zoom, zoom, blocks * static_cast<std::int64_t>(kBlockSize),
      bytes_text(blocks * kBlockBytes)));
}

void note_grids(const std::vector<RasterInfo>& sources, Progress& progress) {
  std::set<const GridInfo*> grids;
  std::size_t joined = 0;
  for (const RasterInfo& source : sources) {
    if (!source.part.whole) continue;
    grids.insert(source.part.whole.get());
    ++joined;
  }
  if (joined == 0) return;
  progress.note(fmt::format(
      "{} of {} inputs lie on {}: read as one raster, without a seam", joined, sources.size(),
      grids.size() == 1 ? "one grid" : fmt::format("{} grids", grids.size())));
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

// A folder's name may hold dots, a file's extension is no part of it.
std::string name_of(const std::filesystem::path& output) {
  const std::filesystem::path plain = plain_path(output);
  const bool is_folder = form_of(output) == TileForm::kFolder;
  return (is_folder ? plain.filename() : plain.stem()).string();
}

LayerJson layer_for(const BuildOptions& options, const Survey& survey, const BuildPlan& plan,
                    const BuildReport& report) {
  LayerJson layer;
  layer.name = options.output.name.empty() ? name_of(options.output.path) : options.output.name;
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
  if (const auto cover = data_cover(survey)) {
    layer.qmpipe_json = with_cover(layer.qmpipe_json, *cover);
  }
  return layer;
}

// What a build keeps on disk besides the tiles: a record to go on from, or a folder that goes with
// the process.
struct RunPlace {
  std::unique_ptr<RunRecord> record;
  std::unique_ptr<ScratchFolder> scratch;
};

std::filesystem::path run_folder(const BuildOptions& options) {
  if (!options.output.run_folder.empty()) return options.output.run_folder;
  return options.output.path.empty() ? std::filesystem::path() : run_folder_of(options.output.path);
}

void note_resumption(const RunRecord& record, Progress& progress) {
  std::string done;
  if (const auto zoom = record.coarsest_surveyed()) {
    done += *zoom == 0 ? ", the survey is done"
                       : fmt::format(", the survey is done down to zoom {}", *zoom);
  }
  if (record.tiles().tiles_done > 0) {
    done += fmt::format(", {} tiles are done", record.tiles().tiles_done);
  }
  progress.note(fmt::format("going on with the run in {}{}", record.folder().string(), done));
}

RunPlace open_place(const BuildOptions& options, Progress& progress) {
  RunPlace place;
  if (options.run.dry_run || options.run.checkpoint_s == 0) return place;
  place.record =
      RunRecord::open(run_folder(options), fingerprint_of(options), options.output.overwrite);
  if (place.record->resumes()) note_resumption(*place.record, progress);
  return place;
}

// Opened before hours of work, so that an output that cannot be used is known at once.
std::unique_ptr<TileSink> open_sink(const BuildOptions& options, const RunPlace& place) {
  if (options.run.dry_run) return nullptr;
  const bool resumes = place.record != nullptr && place.record->resumes();
  std::unique_ptr<TileSink> sink =
      resumes ? resume_tile_sink(options.output.path)
              : open_tile_sink(options.output.path, options.output.overwrite);
  if (place.record != nullptr) place.record->begin_output(options.output.path);
  return sink;
}

MemoryRequest memory_request(const BuildOptions& options) {
  return {.limit_bytes = options.run.memory_bytes,
          .simplify_bytes = simplify_bytes(options.mesh.method),
          .output = form_of(options.output.path)};
}

// A zoom that an earlier run has on disk stays there, however much memory there is now.
MemoryShare share_for(const MemoryDivisions& divisions, std::int32_t sampling_zoom,
                      const RunPlace& place) {
  if (place.record == nullptr) return divisions.best();
  return divisions.best(place.record->coarsest_on_disk(sampling_zoom) - 1);
}

SurveyPlace survey_place(const BuildOptions& options, const MemoryShare& memory, RunPlace& place,
                         Progress& progress) {
  SurveyPlace survey = {.record = place.record.get(), .keep_after_s = options.run.checkpoint_s};
  if (memory.store_bytes == 0) return survey;
  if (place.record == nullptr) place.scratch = std::make_unique<ScratchFolder>(run_folder(options));
  survey.store_folder = place.record != nullptr ? place.record->folder() : place.scratch->path();
  const std::string which =
      memory.last_memory_zoom < 0
          ? ""
          : fmt::format(" of the zooms deeper than {}", memory.last_memory_zoom);
  progress.note(fmt::format("the lattice{} is kept in {}: at most {} of disk", which,
                            survey.store_folder.string(), bytes_text(memory.store_bytes)));
  return survey;
}

// The folder that is there once the sink is open, on the disk that the tiles go to.
std::filesystem::path folder_of(const std::filesystem::path& output) {
  return form_of(output) == TileForm::kFolder ? output : plain_path(output).parent_path();
}

void note_estimate(const BuildOptions& options, const Estimate& estimate, Progress& progress) {
  const std::filesystem::path& output = options.output.path;
  progress.note(fmt::format("{} tiles, about {} and {:.0f} s, memory at most {}", estimate.tiles,
                            bytes_text(estimate.bytes), std::max(1.0, estimate.seconds),
                            bytes_text(estimate.expected_peak_bytes)));
  std::error_code code;
  const std::filesystem::space_info disk = std::filesystem::space(folder_of(output), code);
  if (!code && std::cmp_less(disk.available, estimate.bytes)) {
    progress.note(
        fmt::format("the disk of {} has {} free, too little: the run will stop when it is "
                    "full, and can go on when there is more",
                    output.string(), bytes_text(static_cast<std::int64_t>(disk.available))));
  }
}

// What is known of a build before anything is made on disk.
struct Groundwork {
  SurveyChoice choice;
  std::vector<RasterInfo> sources;
  MemoryDivisions divisions;
};

BuildResult build_in_place(const BuildOptions& options, const Groundwork& ground, RunPlace& place,
                           Progress& progress) {
  const MemoryShare memory =
      share_for(ground.divisions, chosen_sampling_zoom(ground.choice, ground.sources), place);
  set_gdal_cache_bytes(kGdalCacheBytes);
  const std::unique_ptr<TileSink> sink = open_sink(options, place);
  const SurveyPlace survey_in = survey_place(options, memory, place, progress);
  const auto tally = std::make_shared<HeightTally>(options.input.guard);
  const Survey survey =
      run_survey(ground.choice, memory, survey_in, ground.sources, tally, progress);
  give_back_freed_memory();
  note_findings(*tally, ground.choice.heights, progress);
  require_data(survey);
  const BuildPlan plan = plan_build(options, survey);
  for (const std::string& note : plan.notes) progress.note(note);
  const Heightfield heightfield(*survey.store, survey.scheme, plan.recipe.voids,
                                survey.pole_heights);
  BuildResult result;
  result.recipe = plan.recipe;
  result.estimate = keeping_survey(survey, memory, survey_in, progress, [&] {
    return estimate_build(options, survey, plan, heightfield, memory.plan, progress);
  });
  result.estimate.store_bytes = memory.store_bytes;
  progress.event(estimate_json(result.estimate));
  if (options.run.dry_run) return result;
  note_estimate(options, result.estimate, progress);

  progress.correct(mesh_phase(result.estimate));
  result.report = keeping_survey(survey, memory, survey_in, progress, [&] {
    return run_mesh_pass(options, plan, heightfield, memory.plan, *sink, place.record.get(),
                         progress);
  });
  result.report.source_reads = survey.source_reads;
  result.report.survey_s = survey.seconds;
  result.report.peak_resident_bytes = peak_resident_bytes();
  const LayerJson layer = layer_for(options, survey, plan, result.report);
  result.report.built_from = provenance_of(options);
  result.report.layer_version = layer.version;
  const std::string text = write_report(result.report);
  write_file_atomically(report_path(options.output.path),
                        {reinterpret_cast<const std::uint8_t*>(text.data()), text.size()});
  sink->close(write_layer_json(layer));
  return result;
}

// The output's folder and those above it that are not there yet, the deepest first.
std::vector<std::filesystem::path> missing_folders(const std::filesystem::path& output) {
  std::vector<std::filesystem::path> missing;
  if (output.empty()) return missing;
  for (std::filesystem::path folder = folder_of(output);
       !folder.empty() && !std::filesystem::exists(folder); folder = folder.parent_path()) {
    missing.push_back(folder);
  }
  return missing;
}

// What a run that has come to nothing has made for its tiles; a folder that holds something stays.
void remove_empty_folders(const std::vector<std::filesystem::path>& folders) {
  for (const std::filesystem::path& folder : folders) {
    std::error_code not_empty;
    std::filesystem::remove(folder, not_empty);
  }
}

// A finished set of the same inputs and parameters is what was asked for; another one is refused here,
// where it can be said what differs. An unfinished run goes first.
std::optional<FinishedSet> found_set(const BuildOptions& options) {
  if (options.run.dry_run || options.output.overwrite == Overwrite::kYes) return std::nullopt;
  if (RunRecord::is_unfinished(run_folder(options))) return std::nullopt;
  std::optional<FinishedSet> set = finished_set(options);
  if (!set || set->differences.empty()) return set;
  std::string text;
  for (const std::string& difference : set->differences) {
    text += (text.empty() ? "" : "; ") + difference;
  }
  throw IoError("cannot start a tile set in", options.output.path.string(),
                "it holds a finished one, and " + text,
                "Choose another output, or pass --overwrite to replace that tile set.");
}

}  // namespace

SurveyChoice survey_choice(const BuildOptions& options) {
  return {.inputs = options.input.paths,
          .source_crs = options.input.source_crs,
          .heights = options.input.heights,
          .resampling = options.input.resampling,
          .reduction = options.mesh.reduction,
          .scheme = TilingScheme(options.mesh.projection),
          .sampling_zoom = -1,
          .max_zoom = options.mesh.max_zoom.value_or(-1),
          .threads = options.run.threads,
          .open_sources = sources_open_at_once(options.run.threads)};
}

BuildResult build_pyramid(const BuildOptions& options, Progress& progress) {
  require_sound(options);
  const tbb::global_control workers(tbb::global_control::max_allowed_parallelism,
                                    static_cast<std::size_t>(options.run.threads));
  SurveyChoice choice = survey_choice(options);
  std::vector<RasterInfo> sources = describe_inputs(choice);
  if (auto set = found_set(options)) {
    BuildResult result;
    result.found = std::move(set);
    return result;
  }
  require_a_zoom(options, options.mesh.max_zoom.value_or(chosen_sampling_zoom(choice, sources)));
  note_sources(sources, progress);
  note_grids(sources, progress);
  note_sampling(choice, sources, progress);
  progress.expect(phases_of_build(options, choice, sources));
  // Refuses what cannot work before anything is made on disk.
  MemoryDivisions divisions(memory_request(options), choice, sources);
  const Groundwork ground = {.choice = std::move(choice),
                             .sources = std::move(sources),
                             .divisions = std::move(divisions)};
  const std::vector<std::filesystem::path> made = missing_folders(options.output.path);
  RunPlace place = open_place(options, progress);
  try {
    BuildResult result = build_in_place(options, ground, place, progress);
    if (place.record != nullptr) place.record->finish(options.run.keep_run);
    return result;
  } catch (const Interrupted& interrupted) {
    const char* next = "nothing was finished yet";
    if (place.record == nullptr) {
      next = "without checkpoints nothing is kept (build again with --overwrite)";
    } else if (place.record->is_worth_keeping()) {
      next = "the checkpoint is kept: run the same command again to go on";
    }
    throw Interrupted(fmt::format("{}; {}", interrupted.what(), next));
  } catch (const UsageError&) {
    // With other options the survey is another run's.
    if (place.record != nullptr) place.record->discard();
    place = {};
    remove_empty_folders(made);
    throw;
  } catch (const IoError&) {
    const bool goes_on = place.record != nullptr && place.record->is_worth_keeping();
    place = {};
    if (!goes_on) remove_empty_folders(made);
    throw;
  }
}

}  // namespace qmpipe
