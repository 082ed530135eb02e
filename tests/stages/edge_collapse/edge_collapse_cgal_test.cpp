// CGAL as an oracle: its Lindstrom-Turk policies, edge by edge, against ours.
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Surface_mesh.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/Edge_profile.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_cost.h>
#include <CGAL/Surface_mesh_simplification/Policies/Edge_collapse/LindstromTurk_placement.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "stages/edge_collapse/collapse_surface.h"
#include "stages/surface/base_tin.h"

namespace qmpipe::edge_collapse_cgal_test {
namespace {

using Index = CollapseMesh::Index;
using Kernel = CGAL::Simple_cartesian<double>;
using CgalMesh = CGAL::Surface_mesh<Kernel::Point_3>;
namespace smp = CGAL::Surface_mesh_simplification;
using PointMap = boost::property_map<CgalMesh, CGAL::vertex_point_t>::type;
using Profile = smp::Edge_profile<CgalMesh, PointMap, Kernel>;

constexpr std::int32_t kPosts = 9;

// Random heights on a grid whose inner posts have been moved about at random.
Tin random_tin(const PostGrid& grid, std::mt19937_64& random) {
  std::vector<float> heights_m;
  for (std::size_t k = 0; k < grid.post_count(); ++k) {
    heights_m.push_back(static_cast<float>(random() % 1000));
  }
  Tin tin = base_tin(grid, heights_m, {}, 1);
  const std::int32_t reach = grid.u[1] / 4;
  for (TinVertex& vertex : tin.vertices) {
    if (vertex.u == 0 || vertex.v == 0 || vertex.u == grid.u_max() || vertex.v == grid.v_max()) {
      continue;
    }
    const auto some = [&] {
      return static_cast<std::int32_t>(random() % static_cast<unsigned>(2 * reach)) - reach;
    };
    vertex = {.u = vertex.u + some(),
              .v = vertex.v + some(),
              .post = kNoPost,
              .height_m = vertex.height_m};
  }
  return tin;
}

class CgalOracle {
 public:
  // In scaled coordinates, with the same numbers of vertices.
  CgalOracle(const PostGrid& grid, const Tin& tin) {
    double low_m = tin.vertices.front().height_m;
    double high_m = low_m;
    for (const TinVertex& vertex : tin.vertices) {
      low_m = std::min(low_m, vertex.height_m);
      high_m = std::max(high_m, vertex.height_m);
    }
    for (const TinVertex& vertex : tin.vertices) {
      places.push_back({static_cast<double>(vertex.u) / grid.u_max(),
                        static_cast<double>(vertex.v) / grid.v_max(),
                        (vertex.height_m - low_m) / (high_m - low_m)});
      mesh_.add_vertex({places.back().x, places.back().y, places.back().z});
    }
    for (std::size_t k = 0; k < tin.indices.size(); k += 3) {
      mesh_.add_face(CgalMesh::Vertex_index(tin.indices[k]),
                     CgalMesh::Vertex_index(tin.indices[k + 1]),
                     CgalMesh::Vertex_index(tin.indices[k + 2]));
    }
  }

  Profile profile(Index a, Index b) {
    const auto h = mesh_.halfedge(CgalMesh::Vertex_index(static_cast<unsigned>(a)),
                                  CgalMesh::Vertex_index(static_cast<unsigned>(b)));
    return {h,
            mesh_,
            kernel_,
            get(boost::vertex_index, mesh_),
            get(CGAL::vertex_point, mesh_),
            get(boost::halfedge_index, mesh_),
            true};
  }

  std::vector<Vector3> places;

 private:
  CgalMesh mesh_;
  Kernel kernel_;
};

StarSums sums_at(const CollapseMesh& mesh, const std::vector<Vector3>& places, Index v) {
  const auto offset = [&](Index w) {
    return places[static_cast<std::size_t>(w)] - places[static_cast<std::size_t>(v)];
  };
  StarSums sums;
  mesh.each_leaving(v, [&](Index e) {
    sums.add_triangle(
        cross(offset(mesh.target(e)), offset(mesh.origin(CollapseMesh::previous(e)))));
  });
  mesh.each_neighbour(v, [&](Index w) { sums.add_neighbour(offset(w)); });
  return sums;
}

Vector3 our_place(const CollapseMesh& mesh, const std::vector<Vector3>& places, Index e) {
  const Index a = mesh.origin(e);
  const Index b = mesh.target(e);
  const Vector3 here = places[static_cast<std::size_t>(a)];
  const Vector3 along = places[static_cast<std::size_t>(b)] - here;
  const auto tip = [&](Index h) {
    return places[static_cast<std::size_t>(mesh.origin(CollapseMesh::previous(h)))] - here;
  };
  const std::array shared = {
      EdgeTriangle{.normal = cross(along, tip(e)), .tip = tip(e)},
      EdgeTriangle{.normal = cross(tip(mesh.twin(e)), along), .tip = tip(mesh.twin(e))}};
  const EdgeQuadric quadric(sums_at(mesh, places, a), sums_at(mesh, places, b), along, shared);
  return here + quadric.best_place().value();
}

TEST(LindstromTurk, PlacesAndCostsAreThoseOfCgal) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const PostGrid grid = make_plane_grid(kPosts, kPosts, 10, 10);
    const Tin tin = random_tin(grid, random);
    CgalOracle oracle(grid, tin);
    const CollapseWeights weights = {
        .volume = 0.5, .boundary = 0.25, .shape = seed % 2 == 0 ? 1e-10 : 0.01};
    const smp::internal::LindstromTurk_params params(weights.volume, weights.boundary,
                                                     weights.shape);
    const CollapseSurface surface(grid, tin, {}, 1, std::numeric_limits<double>::infinity(),
                                  weights);
    const CollapseMesh& mesh = surface.mesh();
    std::set<int> met;
    for (Index e = 0; e < mesh.half_edge_count(); ++e) {
      const auto cost = surface.cost(e);
      if (mesh.edge(e) != e || !cost) continue;
      const Profile profile = oracle.profile(mesh.origin(e), mesh.target(e));
      const int on_hull = static_cast<int>(mesh.vertex_on_hull(mesh.origin(e))) +
                          static_cast<int>(mesh.vertex_on_hull(mesh.target(e)));
      met.insert(on_hull);
      boost::optional<Kernel::Point_3> place;
      if (on_hull == 0) {
        place = smp::LindstromTurk_placement<CgalMesh>(params)(profile);
        ASSERT_TRUE(place);
        const Vector3 ours = our_place(mesh, oracle.places, e);
        EXPECT_NEAR(ours.x, place->x(), 1e-9);
        EXPECT_NEAR(ours.y, place->y(), 1e-9);
        EXPECT_NEAR(ours.z, place->z(), 1e-9);
      } else {
        // Our rules say where the vertex goes; what that costs is CGAL's formula again.
        const Vector3 kept = oracle.places[static_cast<std::size_t>(surface.best(e)->kept)];
        place = Kernel::Point_3(kept.x, kept.y, kept.z);
      }
      const auto expected = smp::LindstromTurk_cost<CgalMesh>(params)(profile, place);
      ASSERT_TRUE(expected);
      EXPECT_NEAR(*cost / *expected, 1, 1e-9);
    }
    EXPECT_EQ(met.size(), 3U);
  }
}

}  // namespace
}  // namespace qmpipe::edge_collapse_cgal_test
