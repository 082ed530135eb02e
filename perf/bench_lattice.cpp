#include "perf/bench_lattice.h"

#include <benchmark/benchmark.h>

#include <atomic>
#include <chrono>
#include <ctime>
#include <future>

#include "formats/run_store/hdf5_lattice_store.h"
#include "perf/cold_files.h"
#include "scheduler/check.h"
#include "tests/support/lattice_blocks.h"

namespace qmpipe::perf {
namespace {

const TilingScheme kScheme(Projection::kGeodetic);

std::unique_ptr<const LatticeInputs> make_inputs(DemKind kind) {
  const std::int32_t columns = is_small_run() ? 4 : 24;
  const std::int32_t rows = is_small_run() ? 2 : 6;
  // Files are written row by row: without room for a row of blocks, each is packed many times.
  set_gdal_cache_bytes(kWideCacheBytes);
  auto inputs = std::make_unique<LatticeInputs>();
  inputs->dem = std::make_unique<BenchDem>(kind, columns, rows);
  inputs->narrow_cache_bytes = columns * kBlockBytes / 2;
  const auto sampler = open_sampler(inputs->dem->path(), Resampling::kBilinear);
  for (const TileKey& tile : inputs->dem->tiles()) {
    inputs->blocks.emplace_back(kBlockSize);
    sampler->sample(Lattice(kScheme, kDemZoom), posts_of(tile), inputs->blocks.back());
  }
  return inputs;
}

double process_cpu_s() {
  timespec now{};
  ::clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &now);
  return static_cast<double>(now.tv_sec) + static_cast<double>(now.tv_nsec) * 1e-9;
}

}  // namespace

const LatticeInputs& LatticeInputsMaker::get(DemKind kind) {
  if (inputs_ == nullptr || kind_ != kind) {
    inputs_ = make_inputs(kind);
    kind_ = kind;
  }
  return *inputs_;
}

std::unique_ptr<LatticeStore> open_disk_store(const std::filesystem::path& folder,
                                              std::int64_t cache_bytes) {
  auto store =
      open_hdf5_lattice_store(folder, kScheme, {.max_zoom = kDemZoom, .cache_bytes = cache_bytes});
  QMPIPE_CHECK(store);
  return std::move(*store);
}

void put_all(LatticeStore& store, const LatticeInputs& inputs) {
  const std::vector<TileKey>& tiles = inputs.dem->tiles();
  for (std::size_t k = 0; k < tiles.size(); ++k) {
    store.put_block(tiles[k], inputs.blocks[k]);
  }
  store.seal();
}

void visit_windows(const LatticeInputs& inputs, std::span<const FillWindow> fills) {
  const Lattice lattice(kScheme, kDemZoom);
  const std::vector<TileKey>& tiles = inputs.dem->tiles();
  std::atomic<std::size_t> next = 0;
  const auto visit = [&](const FillWindow& fill) {
    std::vector<float> heights_m;
    for (std::size_t k = next++; k < tiles.size(); k = next++) {
      const PostWindow window = Lattice::tile_window(tiles[k], 1);
      heights_m.resize(window.size());
      fill(lattice, window, heights_m);
      benchmark::DoNotOptimize(heights_m.data());
    }
  };
  std::vector<std::future<void>> others;
  for (const FillWindow& fill : fills.subspan(1)) {
    others.push_back(std::async(std::launch::async, visit, fill));
  }
  visit(fills.front());
  for (std::future<void>& other : others) other.get();
}

void read_all(const LatticeStore& store, const LatticeInputs& inputs, std::size_t threads) {
  const std::vector<FillWindow> fills(
      threads, [&store](const Lattice& lattice, const PostWindow& window, std::span<float> out) {
        store.read(lattice, window, out);
      });
  visit_windows(inputs, fills);
}

PassTime read_cold(const std::filesystem::path& folder, const LatticeInputs& inputs,
                   std::int64_t cache_bytes, std::size_t threads) {
  const auto store = open_disk_store(folder, cache_bytes);
  forget_cached_pages(folder);
  return time_of([&] { read_all(*store, inputs, threads); });
}

PassTime time_of(const std::function<void()>& work) {
  const auto started = std::chrono::steady_clock::now();
  const double cpu_started_s = process_cpu_s();
  work();
  return {
      .wall_s = std::chrono::duration<double>(std::chrono::steady_clock::now() - started).count(),
      .cpu_s = process_cpu_s() - cpu_started_s};
}

void measure_passes(benchmark::State& state, const LatticeInputs& inputs,
                    const std::function<PassTime()>& pass) {
  PassTime sum;
  for (auto _ : state) {
    const PassTime time = pass();
    state.SetIterationTime(time.wall_s);
    sum += time;
  }
  const std::int64_t posts = state.iterations() * inputs.dem->post_count();
  state.SetItemsProcessed(posts);
  state.counters["ns_per_post"] = sum.wall_s * 1e9 / static_cast<double>(posts);
  state.counters["cpu_ns_per_post"] = sum.cpu_s * 1e9 / static_cast<double>(posts);
}

void register_passes(const std::string& name, const std::shared_ptr<LatticeInputsMaker>& maker,
                     DemKind kind, const RunPasses& run) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [=](benchmark::State& state) { run(state, maker->get(kind)); })
      ->Unit(benchmark::kMillisecond)
      ->UseManualTime();
}

}  // namespace qmpipe::perf
