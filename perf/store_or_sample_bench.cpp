// Is the deepest zoom better kept on disk, or sampled a second time when the mesh pass needs it?
//
// `store`: put into the HDF5 store, then read every window with its halo. `sample`: every window
// with its halo from the tiled, compressed GeoTIFF. The same terrain, in the same order, with all
// caches empty at the start and as large on both sides: `narrow` holds half a row of blocks, `wide`
// all there is. The first sampling is needed either way and counts on neither side.
#include <benchmark/benchmark.h>

#include "perf/bench_lattice.h"
#include "perf/cold_files.h"
#include "perf/register_benchmarks.h"

namespace qmpipe::perf {
namespace {

enum class Cache { kNarrow, kWide };

std::int64_t bytes_of(Cache cache, const LatticeInputs& inputs) {
  return cache == Cache::kNarrow ? inputs.narrow_cache_bytes : kWideCacheBytes;
}

void store_and_read(benchmark::State& state, const LatticeInputs& inputs, Cache cache) {
  double put_s = 0;
  measure_passes(state, inputs, [&] {
    const testing::TemporaryFolder folder;
    const auto store = open_disk_store(folder.path(), 0);
    PassTime time = time_of([&] { put_all(*store, inputs); });
    put_s += time.wall_s;
    time += read_cold(folder.path(), inputs, bytes_of(cache, inputs));
    return time;
  });
  const auto posts = static_cast<double>(state.iterations() * inputs.dem->post_count());
  state.counters["put_ns_per_post"] = put_s * 1e9 / posts;
}

void sample_again(benchmark::State& state, const LatticeInputs& inputs, Cache cache) {
  set_raster_cache_bytes(bytes_of(cache, inputs));
  measure_passes(state, inputs, [&] {
    forget_cached_pages(inputs.dem->path());
    // GDAL drops a dataset's blocks when it is closed, so a new sampler has none.
    const auto sampler = open_sampler(inputs.dem->path(), Resampling::kBilinear);
    return time_of([&] {
      visit_windows(inputs,
                    [&sampler](const Lattice& lattice, const PostWindow& window,
                               std::span<float> out) { sampler->sample(lattice, window, out); });
    });
  });
}

}  // namespace

void register_benchmarks() {
  const auto maker = std::make_shared<LatticeInputsMaker>();
  for (const DemKind kind : {DemKind::kInt16Deflate, DemKind::kInt16Zstd, DemKind::kFloat32Deflate,
                             DemKind::kUtmDeflate}) {
    for (const Cache cache : {Cache::kNarrow, Cache::kWide}) {
      const std::string name = std::string("store_or_sample/") + name_of(kind) +
                               (cache == Cache::kNarrow ? "/narrow" : "/wide");
      register_passes(name + "/store", maker, kind,
                      [cache](benchmark::State& state, const LatticeInputs& inputs) {
                        store_and_read(state, inputs, cache);
                      });
      register_passes(name + "/sample", maker, kind,
                      [cache](benchmark::State& state, const LatticeInputs& inputs) {
                        sample_again(state, inputs, cache);
                      });
    }
  }
}

}  // namespace qmpipe::perf
