// What does a tile cost from its TIN to its bytes, and how small does it get?
//
// One benchmark a step: strip order, quantization, normals, encoding, gzip at three levels. Bytes
// per triangle come with those that make bytes.
#include <benchmark/benchmark.h>

#include <memory>
#include <string>

#include "formats/bytes/gzip.h"
#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/normals.h"
#include "stages/finish/quantize.h"

namespace qmpipe::perf {
namespace {

// A tile at every step of its way.
struct Steps {
  BenchTile tile;
  HeightSteps height_steps = {};
  Tin inserted;
  Tin ordered;
  QuantizedMesh mesh;  // with normals
  std::vector<std::uint8_t> bytes;
};

std::shared_ptr<const Steps> steps_of(const BenchTile& tile, std::size_t vertices) {
  const GreedyOptions options = options_for_vertices(tile, vertices);
  auto steps = std::make_shared<Steps>();
  steps->tile = tile;
  steps->height_steps = options.height_steps;
  steps->inserted = greedy_insertion(tile.grid, tile.heights_m, {}, options);
  steps->ordered = strip_ordered(steps->inserted);
  steps->mesh = quantize(tile.grid, steps->ordered, options.height_steps);
  steps->mesh.normals =
      tile_normals(tile.scheme, tile.key, tile.grid, tile.window, steps->ordered.vertices);
  steps->bytes = encode(steps->mesh);
  return steps;
}

// Runs `step`, which gives a container of bytes, vertices or triangles.
template <class Step>
void register_step(const std::string& name, const std::shared_ptr<const Steps>& steps,
                   const Step& step) {
  benchmark::RegisterBenchmark(name.c_str(), [steps, step](benchmark::State& state) {
    std::size_t bytes = 0;
    for (auto _ : state) bytes = step(*steps);
    const auto triangles = static_cast<std::int64_t>(steps->ordered.triangle_count());
    state.SetItemsProcessed(state.iterations() * triangles);
    state.counters["triangles"] = static_cast<double>(triangles);
    if (bytes > 0) {
      state.counters["bytes_per_triangle"] =
          static_cast<double>(bytes) / static_cast<double>(triangles);
    }
  })->Unit(benchmark::kMicrosecond);
}

void register_tile(const std::string& name, const std::shared_ptr<const Steps>& steps) {
  register_step("order/" + name, steps, [](const Steps& s) {
    benchmark::DoNotOptimize(strip_ordered(s.inserted).indices.data());
    return std::size_t{0};
  });
  register_step("quantize/" + name, steps, [](const Steps& s) {
    benchmark::DoNotOptimize(quantize(s.tile.grid, s.ordered, s.height_steps).h.data());
    return std::size_t{0};
  });
  register_step("normals/" + name, steps, [](const Steps& s) {
    benchmark::DoNotOptimize(
        tile_normals(s.tile.scheme, s.tile.key, s.tile.grid, s.tile.window, s.ordered.vertices)
            .data());
    return std::size_t{0};
  });
  register_step("encode/" + name, steps, [](const Steps& s) { return encode(s.mesh).size(); });
  for (const int level : {1, 7, 12}) {
    const auto compressor = std::make_shared<GzipCompressor>(level);
    register_step("gzip/" + name + "/level:" + std::to_string(level), steps,
                  [compressor](const Steps& s) { return compressor->compress(s.bytes).size(); });
  }
}

}  // namespace

void register_benchmarks() {
  for (const BenchTile& tile : bench_tiles()) {
    for (const std::size_t vertices : {700U, 2500U}) {
      register_tile(tile.name + "/" + std::to_string(vertices), steps_of(tile, vertices));
    }
  }
}

}  // namespace qmpipe::perf
