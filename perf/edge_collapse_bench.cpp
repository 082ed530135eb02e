// What does edge collapse cost, down to a number of edges and down to a tolerance, beside CGAL's own
// edge collapse on the same triangles with the same costs?
//
// CGAL knows none of our rules (its tiles lose their corners and may fold over), so its time is what
// to compare, not its result. Tolerances are those at which greedy insertion ends with so many
// vertices; `of_greedy` is the share of its triangles that edge collapse needs.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Count_stop_predicate.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <CGAL/Surface_mesh_simplification/edge_collapse.h>
#include <benchmark/benchmark.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <string>
#include <vector>

#include "perf/bench_terrain.h"
#include "perf/register_benchmarks.h"
#include "stages/edge_collapse/edge_collapse.h"
#include "stages/surface/base_tin.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::perf {
namespace {

using Kernel = CGAL::Simple_cartesian<double>;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;
namespace smp = CGAL::Surface_mesh_simplification;

constexpr double kHeightStepM = 1.0 / 64;
constexpr std::int64_t kEdges = 1000;

double rms_error_m(const BenchTile& tile, const std::vector<std::array<double, 2>>& corners,
                   const std::vector<double>& heights_m,
                   const std::vector<std::uint32_t>& indices) {
  const auto places = testing::locate_posts_slowly(tile.grid, corners, indices);
  double sum = 0;
  for (std::size_t k = 0; k < places.size(); ++k) {
    double height_m = 0;
    for (std::size_t c = 0; c < 3; ++c) {
      height_m += places[k].weights[c] * heights_m[indices[3 * places[k].triangle + c]];
    }
    const double error_m = height_m - static_cast<double>(tile.heights_m[k]);
    sum += error_m * error_m;
  }
  return std::sqrt(sum / static_cast<double>(places.size()));
}

void report(benchmark::State& state, const BenchTile& tile, const Tin& tin) {
  std::vector<double> heights_m;
  for (const TinVertex& vertex : tin.vertices) heights_m.push_back(vertex.height_m);
  state.counters["triangles"] = static_cast<double>(tin.triangle_count());
  state.counters["rms_error_m"] =
      rms_error_m(tile, testing::corners_of(tin), heights_m, tin.indices);
}

void to_edges(benchmark::State& state, const BenchTile& tile) {
  const EdgeCollapseOptions options = {.height_steps = kHeightStepM, .least_edges = kEdges};
  Tin tin;
  for (auto _ : state) tin = edge_collapse(tile.grid, tile.heights_m, {}, options);
  report(state, tile, tin);
}

void to_tolerance(benchmark::State& state, const BenchTile& tile, const GreedyOptions& greedy) {
  const EdgeCollapseOptions options = {.height_steps = greedy.height_steps,
                                       .tolerance_m = greedy.tolerance_m};
  Tin tin;
  for (auto _ : state) tin = edge_collapse(tile.grid, tile.heights_m, {}, options);
  report(state, tile, tin);
  const Tin inserted = greedy_insertion(tile.grid, tile.heights_m, {}, greedy);
  state.counters["tolerance_m"] = greedy.tolerance_m;
  state.counters["of_greedy"] =
      static_cast<double>(tin.triangle_count()) / static_cast<double>(inserted.triangle_count());
}

// The dense TIN in the scaled coordinates of edge_collapse().
struct Scaled {
  explicit Scaled(const BenchTile& tile)
      : tin(base_tin(tile.grid, tile.heights_m, {}, kHeightStepM)) {
    const auto by_height = [](const TinVertex& a, const TinVertex& b) {
      return a.height_m < b.height_m;
    };
    const auto [low, high] =
        std::minmax_element(tin.vertices.begin(), tin.vertices.end(), by_height);
    low_m = low->height_m;
    range_m = high->height_m - low_m;
    size = tile.grid.u_max();
  }
  CgalMesh mesh() const {
    CgalMesh mesh;
    for (const TinVertex& vertex : tin.vertices) {
      mesh.add_vertex({vertex.u / size, vertex.v / size, (vertex.height_m - low_m) / range_m});
    }
    for (std::size_t k = 0; k < tin.indices.size(); k += 3) {
      mesh.add_face(CgalMesh::Vertex_index(tin.indices[k]),
                    CgalMesh::Vertex_index(tin.indices[k + 1]),
                    CgalMesh::Vertex_index(tin.indices[k + 2]));
    }
    return mesh;
  }
  Tin tin;
  double low_m = 0;
  double range_m = 0;
  double size = 0;
};

void cgal_to_edges(benchmark::State& state, const BenchTile& tile) {
  const EdgeCollapseOptions options;
  const smp::internal::LindstromTurk_params params(options.volume_weight, options.boundary_weight,
                                                   options.shape_weight);
  const Scaled scaled(tile);
  CgalMesh mesh;
  for (auto _ : state) {
    state.PauseTiming();
    mesh = scaled.mesh();
    state.ResumeTiming();
    smp::edge_collapse(mesh, smp::Count_stop_predicate<CgalMesh>(static_cast<std::size_t>(kEdges)),
                       CGAL::parameters::get_cost(smp::LindstromTurk_cost<CgalMesh>(params))
                           .get_placement(smp::LindstromTurk_placement<CgalMesh>(params)));
  }
  mesh.collect_garbage();
  std::vector<std::array<double, 2>> corners;
  std::vector<double> heights_m;
  std::vector<std::uint32_t> indices;
  for (const auto v : mesh.vertices()) {
    const Kernel::Point_3& p = mesh.point(v);
    corners.push_back({p.x() * scaled.size, p.y() * scaled.size});
    heights_m.push_back(scaled.low_m + p.z() * scaled.range_m);
  }
  for (const auto f : mesh.faces()) {
    for (const auto v : mesh.vertices_around_face(mesh.halfedge(f))) indices.push_back(v);
  }
  state.counters["triangles"] = static_cast<double>(mesh.number_of_faces());
  state.counters["rms_error_m"] = rms_error_m(tile, corners, heights_m, indices);
}

}  // namespace

void register_benchmarks() {
  for (const BenchTile& terrain : bench_tiles()) {
    const auto tile = std::make_shared<const BenchTile>(terrain);
    const auto add = [&](const std::string& name, const auto& run) {
      benchmark::RegisterBenchmark((name + "/" + tile->name).c_str(), run)
          ->Unit(benchmark::kMillisecond);
    };
    add("edge_collapse/1000_edges", [tile](benchmark::State& state) { to_edges(state, *tile); });
    add("cgal/1000_edges", [tile](benchmark::State& state) { cgal_to_edges(state, *tile); });
    for (const std::size_t vertices : {300U, 700U, 1500U, 3000U}) {
      if (is_small_run() && vertices != 300) continue;
      add("edge_collapse/tolerance_of_greedy_" + std::to_string(vertices),
          [tile, greedy = options_for_vertices(*tile, vertices)](benchmark::State& state) {
            to_tolerance(state, *tile, greedy);
          });
    }
  }
}

}  // namespace qmpipe::perf
