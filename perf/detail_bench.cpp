// How fast is the detail-increment model on one core? Collapses with their record, single steps
// between levels an interval of 100 apart, walks from the coarsest level to the finest, and its
// file, whose size is a counter: against raw increments, the fields of Table 1 of the paper.
#include <benchmark/benchmark.h>

#include <filesystem>
#include <vector>

#include "formats/detail_model/file.h"
#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "stages/detail_model/block.h"
#include "stages/detail_model/increment.h"
#include "stages/synth/synth_terrain.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::perf {
namespace {

constexpr double kPixel_deg = 0.001;
constexpr std::size_t kInterval = 100;

struct Grid {
  std::vector<DetailPoint> points;
  std::vector<std::uint32_t> triangles;
  DetailFrame frame = {.offset = {}, .step_m = {80, 111, 1}};
};

// One of four blocks of a DEM of 2,000 x 2,000 posts.
Grid mountains() {
  const std::int32_t side = is_small_run() ? 60 : 1000;
  SynthTerrain terrain({.seed = 3, .pixel_deg = kPixel_deg});
  std::vector<double> longitudes_deg;
  for (std::int32_t i = 0; i < side; ++i) longitudes_deg.push_back(6 + i * kPixel_deg);
  std::vector<std::int16_t> heights_m(longitudes_deg.size());
  Grid grid;
  for (std::int32_t j = 0; j < side; ++j) {
    terrain.sample_row(44 + j * kPixel_deg, longitudes_deg, heights_m);
    for (std::int32_t i = 0; i < side; ++i) {
      grid.points.push_back({.x = i, .y = j, .z = heights_m[static_cast<std::size_t>(i)]});
    }
  }
  for (std::int32_t j = 0; j + 1 < side; ++j) {
    for (std::int32_t i = 0; i + 1 < side; ++i) {
      const auto corner = static_cast<std::uint32_t>(j * side + i);
      const auto up = corner + static_cast<std::uint32_t>(side);
      grid.triangles.insert(grid.triangles.end(), {corner, corner + 1, up, up, corner + 1, up + 1});
    }
  }
  return grid;
}

const Grid& grid() {
  static const Grid once = mountains();
  return once;
}

DetailRecord simplified() {
  const auto all = static_cast<std::int64_t>(grid().triangles.size() / 3);
  return simplify_by_quadrics(grid().points, grid().triangles, grid().frame, all / 5);
}

const DetailBlock& block() {
  static const DetailBlock once =
      make_detail_block(grid().points, grid().triangles, simplified()).block;
  return once;
}

void collapse(benchmark::State& state) {
  grid();
  std::size_t collapses = 0;
  for (auto _ : state) collapses += simplified().collapses.size();
  state.counters["collapses/s"] =
      benchmark::Counter(static_cast<double>(collapses), benchmark::Counter::kIsRate);
}
// The stored form: splits, one by one.
void walk_by_splits(benchmark::State& state) {
  auto walk = DetailWalk::start(block());
  for (auto _ : state) {
    if (walk->go_to(block().levels())) state.SkipWithError("damaged");
    if (walk->go_to(0)) state.SkipWithError("damaged");
  }
  state.counters["splits/s"] = benchmark::Counter(static_cast<double>(2 * block().levels()),
                                                  benchmark::Counter::kIsIterationInvariantRate);
}
// What a viewer does: merged increments, there and back.
void walk_by_increments(benchmark::State& state) {
  auto walk = DetailWalk::start(block());
  std::vector<DetailIncrement> increments;
  std::size_t changed = 0;
  while (walk->level() < block().levels()) {
    auto increment = increment_to(*walk, std::min(walk->level() + kInterval, block().levels()));
    changed += increment->changed();
    increments.push_back(std::move(*increment));
  }
  std::vector<TriangleVertices> triangles;
  for (std::size_t k = 0; k < block().coarse_triangles.size(); k += 3) {
    triangles.push_back({block().coarse_triangles[k], block().coarse_triangles[k + 1],
                         block().coarse_triangles[k + 2]});
  }
  for (auto _ : state) {
    for (const DetailIncrement& increment : increments) refine_by(increment, triangles);
    for (std::size_t k = increments.size(); k-- > 0;) coarsen_by(increments[k], triangles);
  }
  const auto steps = static_cast<double>(2 * increments.size());
  state.counters["steps/s"] =
      benchmark::Counter(steps, benchmark::Counter::kIsIterationInvariantRate);
  state.counters["changed/s"] = benchmark::Counter(2 * static_cast<double>(changed),
                                                   benchmark::Counter::kIsIterationInvariantRate);
}
DetailModel model() {
  DetailModel model;
  model.frame = grid().frame;
  model.interval = kInterval;
  model.blocks = {block()};
  return model;
}

void write_file(benchmark::State& state) {
  const testing::TemporaryFolder folder;
  const DetailModel written = model();
  for (auto _ : state) write_detail_file(folder.path() / "model.h5", written);
  const auto bytes = static_cast<double>(std::filesystem::file_size(folder.path() / "model.h5"));
  const auto splits = static_cast<double>(block().levels());
  double raw_bytes = 0;
  for (const DetailSplit& split : block().splits) raw_bytes += 40 + 28 * split.fan;
  state.counters["bytes/split"] = bytes / splits;
  state.counters["bytes/triangle"] =
      bytes / static_cast<double>(block().triangles_at(block().levels()));
  state.counters["raw_bytes/split"] = raw_bytes / splits;
}

void read_file(benchmark::State& state) {
  const testing::TemporaryFolder folder;
  write_detail_file(folder.path() / "model.h5", model());
  for (auto _ : state) {
    if (!read_detail_file(folder.path() / "model.h5").ok()) state.SkipWithError("damaged");
  }
  state.counters["splits/s"] = benchmark::Counter(static_cast<double>(block().levels()),
                                                  benchmark::Counter::kIsIterationInvariantRate);
}

}  // namespace

void register_benchmarks() {
  const auto add = [](const char* name, const auto& run) {
    benchmark::RegisterBenchmark(name, run)->Unit(benchmark::kMillisecond);
  };
  add("collapse", collapse);
  add("walk/splits", walk_by_splits);
  add("walk/increments_of_100", walk_by_increments);
  add("file/write", write_file);
  add("file/read", read_file);
}

}  // namespace qmpipe::perf
