#include "stages/edge_collapse/collapse_mesh.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>

#include "scheduler/check.h"
#include "stages/edge_collapse/collapse_queue.h"
#include "stages/surface/base_tin.h"

namespace qmpipe::collapse_mesh_test {
namespace {

using Index = CollapseMesh::Index;

std::vector<std::uint32_t> grid_triangles(std::int32_t width, std::int32_t height) {
  const PostGrid grid = make_plane_grid(width, height, 1, 1);
  return base_tin(grid, std::vector<float>(grid.post_count(), 0.0F), {}, 1).indices;
}

CollapseMesh mesh_of(const std::vector<std::uint32_t>& indices) {
  return {indices, static_cast<std::size_t>(*std::max_element(indices.begin(), indices.end())) + 1};
}

// What is wrong with the arrays, found without the mesh's own walks; empty when nothing is.
std::string fault_of(const CollapseMesh& mesh) {
  std::map<std::pair<Index, Index>, Index> by_ends;
  std::map<Index, std::set<Index>> neighbours;
  std::int64_t triangles = 0;
  for (Index e = 0; e < mesh.half_edge_count(); ++e) {
    if (!mesh.is_alive(e)) continue;
    triangles += e % 3 == 0 ? 1 : 0;
    if (!by_ends.insert({{mesh.origin(e), mesh.target(e)}, e}).second) return "half-edge twice";
    neighbours[mesh.origin(e)].insert(mesh.target(e));
    neighbours[mesh.target(e)].insert(mesh.origin(e));
  }
  std::set<Index> edges;
  std::map<Index, int> hull_degree;
  for (const auto& [ends, e] : by_ends) {
    const auto other = by_ends.find({ends.second, ends.first});
    if (mesh.twin(e) != (other == by_ends.end() ? CollapseMesh::kNone : other->second)) {
      return "wrong twin";
    }
    if (mesh.edge(e) != mesh.edge(mesh.on_hull(e) ? e : mesh.twin(e))) return "edge has two names";
    edges.insert(mesh.edge(e));
    if (mesh.on_hull(e)) ++hull_degree[mesh.origin(e)];
  }
  if (triangles != mesh.triangle_count()) return "wrong number of triangles";
  if (static_cast<std::int64_t>(edges.size()) != mesh.edge_count()) return "wrong number of edges";
  if (static_cast<std::int64_t>(neighbours.size()) - mesh.edge_count() + triangles != 1) {
    return "no disk";
  }
  for (Index v = 0; v < mesh.vertex_count(); ++v) {
    if (mesh.vertex_is_alive(v) != (neighbours.count(v) != 0)) return "a vertex without triangles";
    if (!mesh.vertex_is_alive(v)) continue;
    if (mesh.vertex_on_hull(v) != (hull_degree.count(v) != 0)) return "hull vertex not known";
    if (hull_degree.count(v) != 0 && hull_degree[v] != 1) return "pinched";
    std::multiset<Index> walked;
    mesh.each_neighbour(v, [&](Index w) { walked.insert(w); });
    if (walked != std::multiset<Index>(neighbours[v].begin(), neighbours[v].end())) {
      return "walk misses neighbours";
    }
    std::multiset<Index> walked_edges;
    mesh.each_edge(v, [&](Index e) { walked_edges.insert(e); });
    if (walked_edges.size() != walked.size()) return "walk misses edges";
  }
  return "";
}

TEST(CollapseMesh, KnowsTheTwinsAndTheHullOfAGrid) {
  const CollapseMesh mesh = mesh_of(grid_triangles(5, 4));
  EXPECT_EQ(fault_of(mesh), "");
  EXPECT_EQ(mesh.triangle_count(), 24);
  EXPECT_EQ(mesh.edge_count(), 43);
}

TEST(CollapseMesh, StaysADiskWhateverIsCollapsedDownToOneTriangle) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto width = static_cast<std::int32_t>(2 + random() % 5);
    const auto height = static_cast<std::int32_t>(2 + random() % 5);
    CollapseMesh mesh = mesh_of(grid_triangles(width, height));
    for (;;) {
      std::vector<Index> possible;
      for (Index e = 0; e < mesh.half_edge_count(); ++e) {
        if (mesh.is_alive(e) && mesh.may_collapse(e)) possible.push_back(e);
      }
      if (possible.empty()) break;
      const Index e = possible[random() % possible.size()];
      const bool on_hull = mesh.on_hull(e);
      const std::int64_t edges = mesh.edge_count();
      const std::int64_t triangles = mesh.triangle_count();
      const Index kept = random() % 2 == 0 ? mesh.origin(e) : mesh.target(e);
      const Index removed = kept == mesh.origin(e) ? mesh.target(e) : mesh.origin(e);
      mesh.collapse(e, kept);
      ASSERT_EQ(fault_of(mesh), "");
      ASSERT_TRUE(mesh.vertex_is_alive(kept));
      ASSERT_FALSE(mesh.vertex_is_alive(removed));
      ASSERT_EQ(mesh.edge_count(), edges - (on_hull ? 2 : 3));
      ASSERT_EQ(mesh.triangle_count(), triangles - (on_hull ? 1 : 2));
    }
    // A disk with more than one triangle always has an edge to collapse.
    ASSERT_EQ(mesh.triangle_count(), 1);
  }
}

TEST(CollapseMesh, RefusesWhatWouldNotBeADisk) {
  // Two triangles that share the edge 0-2: its ends both lie on the hull.
  CollapseMesh square = mesh_of({0, 1, 2, 0, 2, 3});
  EXPECT_FALSE(square.may_collapse(2));
  EXPECT_FALSE(square.may_collapse(3));
  EXPECT_TRUE(square.may_collapse(0));
  // Its tip would be left behind.
  EXPECT_FALSE(mesh_of({0, 1, 2}).may_collapse(0));
  // A triangle in a triangle: 0 and 1 have both 2 and 3 in common, which is one too many on the hull;
  // 3 is inside and may go anywhere.
  CollapseMesh inside = mesh_of({0, 1, 3, 1, 2, 3, 2, 0, 3});
  EXPECT_FALSE(inside.may_collapse(0));
  EXPECT_TRUE(inside.may_collapse(1));
}

TEST(CollapseMesh, ChecksThatItIsGivenASurface) {
  // An edge with three triangles, a vertex in no triangle, two triangles that touch in a vertex.
  EXPECT_THROW(CollapseMesh(std::vector<std::uint32_t>{0, 1, 2, 1, 0, 3, 1, 0, 4}, 5),
               InternalError);
  EXPECT_THROW(CollapseMesh(std::vector<std::uint32_t>{0, 1, 2}, 4), InternalError);
  EXPECT_THROW(CollapseMesh(std::vector<std::uint32_t>{0, 1, 2, 2, 3, 4}, 5), InternalError);
  EXPECT_NO_THROW(CollapseMesh(std::vector<std::uint32_t>{0, 1, 2, 3, 4, 5}, 6));
  EXPECT_THROW(CollapseMesh(std::vector<std::uint32_t>{0, 1, 9}, 3), InternalError);
}

TEST(CollapseQueue, GivesTheCheapestThenTheLowestEdgeWhateverChangedBefore) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    CollapseQueue queue(60);
    std::map<Index, double> expected;
    for (int step = 0; step < 2000; ++step) {
      const auto edge = static_cast<Index>(random() % 60);
      if (random() % 3 == 0) {
        queue.remove(edge);
        expected.erase(edge);
      } else {
        const auto cost = static_cast<double>(random() % 8);
        queue.set(edge, cost);
        expected[edge] = cost;
      }
      ASSERT_EQ(queue.contains(edge), expected.count(edge) != 0);
      ASSERT_EQ(queue.empty(), expected.empty());
      if (expected.empty()) continue;
      const auto best =
          std::min_element(expected.begin(), expected.end(),
                           [](const auto& a, const auto& b) { return a.second < b.second; });
      ASSERT_EQ(queue.top().edge, best->first);
      ASSERT_EQ(queue.top().cost, best->second);
    }
  }
}

}  // namespace
}  // namespace qmpipe::collapse_mesh_test
