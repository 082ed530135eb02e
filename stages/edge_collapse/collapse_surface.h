// A TIN whose edges are collapsed by the rules of Campos et al. 2020, section 4.2: which edges may,
// where the vertex goes and what it costs. Knows of no tolerance (stages/edge_collapse/collapse_tolerance.h) and of no
// order (stages/edge_collapse/edge_collapse.cpp).
//
// Guarantees: whatever collapses fits() allows, the triangles cover the rectangle once, each
// counter-clockwise; corners stay; fixed sides stay as they are; vertices on free sides are some of
// those that were there; vertices that move go to whole units inside the rectangle, and to heights
// that are multiples of the step within the range of the first TIN's.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "stages/edge_collapse/collapse_mesh.h"
#include "stages/edge_collapse/lindstrom_turk.h"
#include "stages/surface/delaunay.h"
#include "stages/surface/tin.h"

namespace qmpipe {

class CollapseSurface {
 public:
  using Index = CollapseMesh::Index;
  static constexpr Index kNone = CollapseMesh::kNone;

  // The vertex that an edge may become. `kept`: the end that stays as it is, kNone when both go. The
  // cost is that of the place before rounding.
  struct Candidate {
    TinVertex vertex;
    Index kept = kNone;
    double cost = 0;
  };

  // Free sides keep the posts that side_stride_posts() asks for with this depth.
  // REQUIRES: a TIN of the grid's rectangle with the fixed sides' vertices.
  CollapseSurface(const PostGrid& grid, const Tin& tin, const FixedBorders& fixed,
                  const HeightSteps& height_steps, double side_depth_m,
                  const CollapseWeights& weights);

  const CollapseMesh& mesh() const { return mesh_; }
  const TinVertex& vertex(Index v) const { return vertices_[at(v)]; }

  // What the rules make of an edge; none when they forbid it.
  std::optional<Candidate> best(Index e) const;
  // Its cost alone, which is quicker.
  std::optional<double> cost(Index e) const;
  // Other vertices for an edge whose best one does not do, cheapest first. None where the rules leave
  // no choice.
  std::vector<Candidate> others(Index e) const;
  // Whether the mesh stays a disk of counter-clockwise triangles.
  bool fits(Index e, const Candidate& candidate);
  // REQUIRES: fits(e, candidate). Returns the vertex.
  Index collapse(Index e, const Candidate& candidate);

  // Calls each(x, y) for the edges round the collapse that make a new triangle with its vertex,
  // counter-clockwise; stops at the first false and returns it.
  template <class Each>
  bool each_new_triangle(Index e, Index kept, const Each& each) const;

  // Moves what is left together, numbered anew in the same order, with sums computed anew. The scaled
  // coordinates and the range of heights stay those of the first TIN.
  void compact();
  // What is left, without gaps, in the order of the first TIN.
  Tin tin() const;

 private:
  struct HeightRange {
    double low_m = 0;
    double high_m = 0;
  };
  static HeightRange height_range(const Tin& tin);
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  IntPoint point(Index v) const { return {vertices_[at(v)].u, vertices_[at(v)].v}; }
  Vector3 scaled(const TinVertex& vertex) const {
    return {vertex.u * scale_.x, vertex.v * scale_.y,
            (vertex.height_m - heights_.low_m) * scale_.z};
  }
  // A corner, or a post without which a side's chord would sink too deep.
  bool is_pinned(Index v) const;
  void start();
  void update_sums(Index v);
  // Adds what v contributes to its neighbours' sums, `other`'s excepted: factor 1, or -1 to take it out.
  void add_to_ring(Index v, Index other, double factor);
  EdgeQuadric quadric(Index e) const;
  double boundary_cost(Index e, const Vector3& place) const;
  double cost_of(Index e, const EdgeQuadric& quadric, const Vector3& place) const;
  // Where the rules put the vertex, before rounding.
  struct Plan {
    Vector3 place;
    Index kept = kNone;
    double cost = 0;
  };
  std::optional<Plan> plan(Index e) const;
  Plan keeping(Index e, const EdgeQuadric& quadric, Index kept) const;
  Candidate candidate(Index e, const Plan& plan) const;
  TinVertex rounded(const Vector3& place) const;

  const PostGrid& grid_;
  CollapseWeights weights_;
  HeightSteps height_steps_;
  std::array<std::int32_t, 4> strides_{};  // in posts, by side
  HeightRange heights_;
  Vector3 scale_;  // from units and metres to the scaled coordinates of section 4.4.1
  CollapseMesh mesh_;
  std::vector<TinVertex> vertices_;
  std::vector<Vector3> places_;  // scaled
  std::vector<StarSums> sums_;
  std::vector<std::uint8_t> sides_;  // of each vertex: bit index_of(side) when it lies there
  std::uint8_t fixed_sides_ = 0;
};

template <class Each>
bool CollapseSurface::each_new_triangle(Index e, Index kept, const Each& each) const {
  const Index f = mesh_.twin(e);
  bool all = true;
  for (const Index end : {mesh_.origin(e), mesh_.target(e)}) {
    if (end == kept) continue;
    mesh_.each_leaving(end, [&](Index k) {
      if (!all || k / 3 == e / 3 || (f != kNone && k / 3 == f / 3)) return;
      const Index opposite = CollapseMesh::next(k);
      all = each(mesh_.origin(opposite), mesh_.target(opposite));
    });
  }
  return all;
}

}  // namespace qmpipe
