#include "pipeline/build/mesh_pass.h"

#include <fmt/format.h>

#include <array>
#include <optional>

#include "formats/bytes/errors.h"
#include "formats/bytes/hash64.h"
#include "formats/run_store/hdf5_border_store.h"
#include "pipeline/build/checkpointer.h"
#include "pipeline/build/report_state.h"
#include "pipeline/build/tile_graph.h"
#include "pipeline/common/stopwatch.h"

namespace qmpipe {
namespace {

BuildReport empty_report(const BuildOptions& options, const BuildPlan& plan,
                         const MemoryPlan& memory) {
  BuildReport report;
  report.method = plan.recipe.method;
  report.stop = plan.recipe.stop;
  report.threads = options.run.threads;
  report.max_in_flight = memory.max_in_flight;
  report.expected_peak_bytes = memory.expected_peak_bytes;
  for (std::int32_t zoom = plan.recipe.min_zoom; zoom <= plan.recipe.max_zoom; ++zoom) {
    const auto at = static_cast<std::size_t>(zoom);
    BuiltZoom& row = report.zooms.emplace_back();
    row.zoom = zoom;
    row.tolerance_m = plan.recipe.error_bound_m(zoom);
    row.height_step_m = plan.recipe.height_step_m[at];
    row.parameters = plan.recipe.parameters_at(zoom);
  }
  return report;
}

// Names the plan: what is to be built, how, and in which order.
std::string plan_text(const BuildPlan& plan) {
  std::uint64_t hash = 0;
  for (const PlannedTile& tile : plan.wavefront.tiles) {
    std::array<std::uint8_t, sizeof(std::uint64_t)> word{};
    store_little_endian(word.data(), packed(tile.key));
    hash = hash64(word, hash);
  }
  return fmt::format(R"({{"recipe":{},"tiles":{},"order":"{:016x}"}})", write_recipe(plan.recipe),
                     plan.tile_count(), hash);
}

// The first of the schedule's first `count` tiles that the sink does not have.
std::optional<TileKey> missing_tile(const TileSink& sink, const BuildPlan& plan,
                                    std::int64_t count) {
  for (std::int64_t k = 0; k < count; ++k) {
    const TileKey& key = plan.wavefront.tiles[static_cast<std::size_t>(k)].key;
    if (!sink.has(key)) return key;
  }
  return std::nullopt;
}

std::unique_ptr<BorderStore> open_borders(const BuildPlan& plan, const Heightfield& heightfield,
                                          const RunRecord* record) {
  if (record == nullptr) return make_memory_border_store();
  auto store = open_hdf5_border_store(record->folder(), heightfield.scheme(),
                                      {.max_zoom = plan.recipe.max_zoom});
  if (store) return std::move(store.value());
  throw IoError("cannot go on with the run in", record->folder().string(), store.error().message,
                "");
}

// The sums of the tiles that an earlier run has left in the sink.
BuildReport resumed_report(const BuildReport& empty, const BuildPlan& plan, const TileSink& sink,
                           RunRecord& record, Progress& progress) {
  const TileCheckpoint& tiles = record.tiles();
  if (tiles.tiles_done == 0) return empty;
  if (const auto missing = missing_tile(sink, plan, tiles.tiles_done)) {
    progress.note(
        fmt::format("tile {} is gone, which the journal counts as done: all tiles are meshed again",
                    to_string(*missing)));
    // At once: a crash must not find them there again, unsynced, and count them.
    record.add_tiles({.tiles_done = 0,
                      .border_segments = tiles.border_segments,
                      .report_state = write_report_state(empty)});
    return empty;
  }
  auto report = with_report_state(empty, tiles.report_state);
  if (!report || report->tiles != tiles.tiles_done) {
    record.refuse(report ? "its statistics count other tiles than its journal"
                         : report.error().message);
  }
  report->resumed_tiles = tiles.tiles_done;
  progress.note(
      fmt::format("going on: {} of {} tiles are done", tiles.tiles_done, plan.tile_count()));
  return std::move(report.value());
}

}  // namespace

BuildReport run_mesh_pass(const BuildOptions& options, const BuildPlan& plan,
                          const Heightfield& heightfield, const MemoryPlan& memory, TileSink& sink,
                          RunRecord* record, Progress& progress) {
  BuildReport report = empty_report(options, plan, memory);
  const Stopwatch watch;
  const std::unique_ptr<BorderStore> borders = open_borders(plan, heightfield, record);
  std::optional<Checkpointer> checkpointer;
  if (record != nullptr) {
    record->set_plan(plan_text(plan));
    report = resumed_report(report, plan, sink, *record, progress);
    checkpointer.emplace(sink, *borders, *record, options.run.checkpoint_s);
  }
  const TileGraphResult result =
      run_tile_graph(plan, heightfield, *borders, sink,
                     {.threads = options.run.threads,
                      .max_in_flight = memory.max_in_flight,
                      .gzip_level = options.encode.gzip_level,
                      .first_tile = static_cast<TileIndex>(report.tiles)},
                     progress, [&](const TileWork& work) {
                       report.add(work);
                       if (checkpointer) checkpointer->after_tile(report);
                     });
  if (result.stopped) {
    if (checkpointer) checkpointer->write_now(report);
    throw Interrupted(
        fmt::format("stopped after {} of {} tiles", result.tiles_done, plan.tile_count()));
  }
  // What comes now may be interrupted too.
  if (checkpointer) checkpointer->write_now(report);
  QMPIPE_CHECK(borders->size() == 0);
  if (const auto missing = missing_tile(sink, plan, plan.tile_count())) {
    throw IoError("cannot finish", options.output.path.string(),
                  fmt::format("tile {} was written and is gone", to_string(*missing)),
                  "Run the same command again; what is missing is built again.");
  }
  report.largest_in_flight = result.largest_in_flight;
  report.mesh_s = watch.seconds();
  return report;
}

}  // namespace qmpipe
