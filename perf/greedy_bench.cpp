// What does greedy insertion cost, by the number of vertices it ends with?
//
// The tolerance is searched for beforehand, so that made-up and real terrain compare at equal
// counts. Flat terrain is the least work there is, noise the most.
#include <benchmark/benchmark.h>

#include <memory>
#include <random>
#include <string>

#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::perf {
namespace {

constexpr std::uint64_t kSeed = 1;

void insert(benchmark::State& state, const BenchTile& tile, const GreedyOptions& options) {
  std::size_t vertices = 0;
  for (auto _ : state) {
    const Tin tin = greedy_insertion(tile.grid, tile.heights_m, {}, options);
    vertices = tin.vertices.size();
    benchmark::DoNotOptimize(tin.indices.data());
  }
  state.SetItemsProcessed(state.iterations() * static_cast<std::int64_t>(vertices));
  state.counters["vertices"] = static_cast<double>(vertices);
  state.counters["tolerance_m"] = options.tolerance_m;
}

void register_case(const std::string& name, const std::shared_ptr<const BenchTile>& tile,
                   const GreedyOptions& options) {
  benchmark::RegisterBenchmark(name.c_str(), [tile, options](benchmark::State& state) {
    insert(state, *tile, options);
  })->Unit(benchmark::kMicrosecond);
}

void register_edge_case(const BenchTile& like, testing::Terrain terrain, double tolerance_m) {
  auto tile = std::make_shared<BenchTile>(like);
  std::mt19937_64 random(kSeed);
  tile->heights_m = testing::random_terrain(terrain, random);
  register_case(std::string("greedy/") + testing::name_of(terrain), tile,
                options_for(*tile, tolerance_m));
}

}  // namespace

void register_benchmarks() {
  const auto tiles = bench_tiles();
  for (const BenchTile& terrain : tiles) {
    const auto tile = std::make_shared<const BenchTile>(terrain);
    for (const std::size_t vertices : {100U, 300U, 700U, 2000U, 6000U}) {
      register_case("greedy/" + tile->name + "/" + std::to_string(vertices), tile,
                    options_for_vertices(*tile, vertices));
    }
  }
  register_edge_case(tiles.front(), testing::Terrain::kFlat, 5);
  // Uniform between -25 and 25 m: two posts in three become vertices.
  register_edge_case(tiles.front(), testing::Terrain::kNoise, 12);
}

}  // namespace qmpipe::perf
