// What does point-set simplification cost, by method?
//
// With the paper's parameters for zoom 10 (Table 3), and WLOP also with radii that have neighbours
// in them: posts are some 76 m apart.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>

#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "stages/point_sets/point_set.h"

namespace qmpipe::perf {
namespace {

void simplify(benchmark::State& state, const BenchTile& tile, const PointSetOptions& options) {
  std::size_t vertices = 0;
  for (auto _ : state) {
    const Tin tin = simplify_point_set(tile.grid, tile.heights_m, {}, options);
    vertices = tin.vertices.size();
    benchmark::DoNotOptimize(tin.indices.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(kTilePostCount));
  state.counters["vertices"] = static_cast<double>(vertices);
}

void register_case(const std::string& name, const std::shared_ptr<const BenchTile>& tile,
                   const PointSetOptions& options) {
  benchmark::RegisterBenchmark(
      ("point_set/" + tile->name + "/" + name).c_str(),
      [tile, options](benchmark::State& state) { simplify(state, *tile, options); })
      ->Unit(benchmark::kMillisecond);
}

}  // namespace

void register_benchmarks() {
  for (const BenchTile& terrain : bench_tiles()) {
    const auto tile = std::make_shared<const BenchTile>(terrain);
    PointSetOptions options{.height_steps = 0.25};
    register_case("random", tile, options);
    options.method = PointSetMethod::kGrid;
    register_case("grid", tile, options);
    options.method = PointSetMethod::kHierarchy;
    register_case("hierarchy", tile, options);
    options.method = PointSetMethod::kWlop;
    for (const int radius_m : {5, 25, 100, 400}) {
      options.neighbour_radius_m = radius_m;
      register_case("wlop/" + std::to_string(radius_m), tile, options);
    }
  }
}

}  // namespace qmpipe::perf
