// Is the deepest zoom better kept on disk, or sampled a second time when the mesh pass needs it?
//
// `store`: put into the HDF5 store, then read every window with its halo. `sample`: every window
// with its halo from the tiled, compressed GeoTIFF. The same terrain, in the same order, with all
// caches empty at the start and as large on both sides: `narrow` holds half a row of blocks, `wide`
// all there is. The first sampling is needed either way and counts on neither side. With several
// threads each has a dataset of its own, as GDAL wants it, and they share GDAL's cache; the store is
// one for all. Compare their CPU times: that of the wall depends on how many cores are free.
#include <benchmark/benchmark.h>

#include "perf/bench_lattice.h"
#include "perf/cold_files.h"
#include "perf/register_benchmarks.h"

namespace qmpipe::perf {
namespace {

enum class Cache { kNarrow, kWide };

struct Circumstances {
  Cache cache = Cache::kNarrow;
  std::size_t threads = 1;
};

std::int64_t cache_bytes_of(const Circumstances& now, const LatticeInputs& inputs) {
  return now.cache == Cache::kNarrow ? inputs.narrow_cache_bytes : kWideCacheBytes;
}

void store_and_read(benchmark::State& state, const LatticeInputs& inputs,
                    const Circumstances& now) {
  double put_cpu_s = 0;
  measure_passes(state, inputs, [&] {
    const testing::TemporaryFolder folder;
    const auto store = open_disk_store(folder.path(), 0);
    PassTime time = time_of([&] { put_all(*store, inputs); });
    put_cpu_s += time.cpu_s;
    time += read_cold(folder.path(), inputs, cache_bytes_of(now, inputs), now.threads);
    return time;
  });
  const auto posts = static_cast<double>(state.iterations() * inputs.dem->post_count());
  state.counters["put_cpu_ns_per_post"] = put_cpu_s * 1e9 / posts;
}

void sample_again(benchmark::State& state, const LatticeInputs& inputs, const Circumstances& now) {
  set_gdal_cache_bytes(cache_bytes_of(now, inputs));
  measure_passes(state, inputs, [&] {
    // GDAL drops a dataset's blocks when it is closed, so new samplers have none.
    std::vector<FillWindow> fills;
    for (std::size_t k = 0; k < now.threads; ++k) {
      const std::shared_ptr<Sampler> sampler =
          open_sampler(inputs.dem->path(), Resampling::kBilinear);
      fills.emplace_back(
          [sampler](const Lattice& lattice, const PostWindow& window, std::span<float> out) {
            sampler->sample(lattice, window, out);
          });
    }
    forget_cached_pages(inputs.dem->path());
    return time_of([&] { visit_windows(inputs, fills); });
  });
}

using Way = void (*)(benchmark::State&, const LatticeInputs&, const Circumstances&);

void register_way(const std::string& name, const std::shared_ptr<LatticeInputsMaker>& maker,
                  DemKind kind, const Circumstances& now, Way way) {
  register_passes(name, maker, kind,
                  [now, way](benchmark::State& state, const LatticeInputs& inputs) {
                    way(state, inputs, now);
                  });
}

}  // namespace

void register_benchmarks() {
  struct Case {
    const char* name;
    Circumstances now;
  };
  const auto maker = std::make_shared<LatticeInputsMaker>();
  for (const DemKind kind : {DemKind::kInt16Deflate, DemKind::kInt16Zstd, DemKind::kFloat32Deflate,
                             DemKind::kUtmDeflate}) {
    for (const Case& c : {Case{"wide", {.cache = Cache::kWide, .threads = 1}},
                          Case{"narrow", {.cache = Cache::kNarrow, .threads = 1}},
                          Case{"narrow_4_threads", {.cache = Cache::kNarrow, .threads = 4}}}) {
      const std::string name = std::string("store_or_sample/") + name_of(kind) + "/" + c.name;
      register_way(name + "/store", maker, kind, c.now, store_and_read);
      register_way(name + "/sample", maker, kind, c.now, sample_again);
    }
  }
}

}  // namespace qmpipe::perf
