// What do the stores cost? Puts of all blocks and reads of all windows of one zoom, and borders.
//
// `read_warm` reads a store that has every block in its cache; `read_cold` starts with empty caches.
#include <benchmark/benchmark.h>

#include "formats/run_store/border_store.h"
#include "perf/bench_lattice.h"
#include "perf/register_benchmarks.h"

namespace qmpipe::perf {
namespace {

namespace fs = std::filesystem;

const TilingScheme kScheme(Projection::kGeodetic);

double bytes_per_post(const fs::path& folder, const LatticeInputs& inputs) {
  std::uintmax_t bytes = 0;
  for (const auto& entry : fs::directory_iterator(folder)) bytes += entry.file_size();
  return static_cast<double>(bytes) / static_cast<double>(inputs.dem->post_count());
}

void memory_put(benchmark::State& state, const LatticeInputs& inputs) {
  measure_passes(state, inputs, [&] {
    const auto store = make_memory_lattice_store(kScheme, kDemZoom);
    return time_of([&] { put_all(*store, inputs); });
  });
}

void memory_read(benchmark::State& state, const LatticeInputs& inputs) {
  const auto store = make_memory_lattice_store(kScheme, kDemZoom);
  put_all(*store, inputs);
  measure_passes(state, inputs, [&] { return time_of([&] { read_all(*store, inputs, 1); }); });
}

void disk_put(benchmark::State& state, const LatticeInputs& inputs) {
  double stored_bytes_per_post = 0;
  measure_passes(state, inputs, [&] {
    const testing::TemporaryFolder folder;
    const auto store = open_disk_store(folder.path(), 0);
    const PassTime time = time_of([&] { put_all(*store, inputs); });
    stored_bytes_per_post = bytes_per_post(folder.path(), inputs);
    return time;
  });
  state.counters["bytes_per_post"] = stored_bytes_per_post;
}

void disk_read_warm(benchmark::State& state, const LatticeInputs& inputs) {
  const testing::TemporaryFolder folder;
  const auto store = open_disk_store(folder.path(), 2 * kWideCacheBytes);
  put_all(*store, inputs);
  read_all(*store, inputs, 1);
  measure_passes(state, inputs, [&] { return time_of([&] { read_all(*store, inputs, 1); }); });
}

void disk_read_cold(benchmark::State& state, const LatticeInputs& inputs) {
  const testing::TemporaryFolder folder;
  put_all(*open_disk_store(folder.path(), 0), inputs);
  measure_passes(state, inputs,
                 [&] { return read_cold(folder.path(), inputs, kWideCacheBytes, 1); });
}

void publish_and_take(benchmark::State& state) {
  constexpr std::int32_t kTiles = 1024;
  const auto store = make_memory_border_store();
  BorderMask mask;
  mask.set(0);
  mask.set(kTileIntervals);
  for (auto _ : state) {
    for (std::int32_t x = 0; x < kTiles; ++x) {
      store->publish({.zoom = kDemZoom, .x = x, .y = 512}, Side::kNorth, mask);
    }
    for (std::int32_t x = 0; x < kTiles; ++x) {
      benchmark::DoNotOptimize(store->take({.zoom = kDemZoom, .x = x, .y = 512}, Side::kNorth));
    }
  }
  state.SetItemsProcessed(state.iterations() * kTiles);
}

}  // namespace

void register_benchmarks() {
  benchmark::RegisterBenchmark("border/memory/publish_take", publish_and_take)
      ->Unit(benchmark::kMicrosecond);
  const auto maker = std::make_shared<LatticeInputsMaker>();
  register_passes("lattice/memory/put", maker, DemKind::kInt16Deflate, memory_put);
  register_passes("lattice/memory/read", maker, DemKind::kInt16Deflate, memory_read);
  register_passes("lattice/hdf5/put", maker, DemKind::kInt16Deflate, disk_put);
  register_passes("lattice/hdf5/read_warm", maker, DemKind::kInt16Deflate, disk_read_warm);
  register_passes("lattice/hdf5/read_cold", maker, DemKind::kInt16Deflate, disk_read_cold);
}

}  // namespace qmpipe::perf
