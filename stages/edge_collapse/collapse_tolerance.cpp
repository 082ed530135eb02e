#include "stages/edge_collapse/collapse_tolerance.h"

#include <algorithm>
#include <cmath>

#include "stages/surface/array_index.h"

namespace qmpipe {

CollapseTolerance::CollapseTolerance(const PostGrid& grid, std::span<const float> heights_m,
                                     double tolerance_m, const HeightSteps& height_steps,
                                     Curvature curvature, const CollapseSurface& surface,
                                     const FixedBorders& fixed)
    : grid_(grid),
      surface_(surface),
      errors_(grid, heights_m, tolerance_m, height_steps, curvature),
      blocked_(grid.post_count(), 0) {
  for (Index v = 0; v < surface.mesh().vertex_count(); ++v) {
    blocked_[at(surface.vertex(v).post)] = 1;
  }
  for (const Side side : kSides) {
    for (std::int32_t k = 0; fixed[index_of(side)] && k < kTilePosts; ++k) {
      const Post p = side_post(side, k);
      blocked_[at(grid.index(p.i, p.j))] = 1;
    }
  }
}

CollapseTolerance::Rows CollapseTolerance::rows_of(const TinVertex& vertex) const {
  if (vertex.post != kNoPost) return {grid_.row(vertex.post), grid_.row(vertex.post)};
  const auto above = std::lower_bound(grid_.v.begin(), grid_.v.end(), vertex.v);
  const auto row = static_cast<std::int32_t>(above - grid_.v.begin());
  return {std::max(0, row - 1),
          std::min(grid_.height_posts - 1, *above == vertex.v ? row + 1 : row)};
}

PostErrors::Corner CollapseTolerance::corner(const TinVertex& vertex) const {
  return {.place = {vertex.u, vertex.v}, .height_m = vertex.height_m - errors_.base_m()};
}

bool CollapseTolerance::holds(const std::array<const TinVertex*, 3>& triangle) {
  PostErrors::Corners corners;
  std::int32_t j_first = grid_.height_posts - 1;
  std::int32_t j_last = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    corners[k] = corner(*triangle[k]);
    const Rows rows = rows_of(*triangle[k]);
    j_first = std::min(j_first, rows.below);
    j_last = std::max(j_last, rows.above);
  }
  const Worst worst = errors_.worst_post(corners, j_first, j_last);
  if (worst.error <= errors_.threshold_m()) return true;
  if (blocked_[at(worst.post)] == 0) return false;
  return errors_.worst_free_post(corners, j_first, j_last, blocked_).error <= errors_.threshold_m();
}

// The error of a decoded tile (stages/finish/tile_error.h) is taken at the vertex where one stands at a post.
bool CollapseTolerance::agrees_with_its_post(const TinVertex& vertex) const {
  const std::int32_t post = post_at(grid_, vertex.u, vertex.v);
  if (post == kNoPost) return true;
  return std::abs(vertex.height_m - errors_.base_m() -
                  static_cast<double>(errors_.height_m(post))) <=
         static_cast<double>(errors_.threshold_m());
}

// A post stands up to half a unit from its vertex. Where that is beyond the vertex's triangles, one
// holds it that is not to be judged again.
bool CollapseTolerance::is_in_star(Index v) const {
  const CollapseMesh& mesh = surface_.mesh();
  const std::int32_t post = surface_.vertex(v).post;
  const double x = grid_.u_exact[at(grid_.column(post))];
  const double y = grid_.v_exact[at(grid_.row(post))];
  bool is_inside = true;
  mesh.each_leaving(v, [&](Index e) {
    const TinVertex& from = surface_.vertex(mesh.target(e));
    const TinVertex& to = surface_.vertex(mesh.origin(CollapseMesh::previous(e)));
    is_inside &= (to.u - from.u) * (y - from.v) - (to.v - from.v) * (x - from.u) >= 0;
  });
  return is_inside;
}

void CollapseTolerance::set_blocked(Index v, Index kept, std::uint8_t value) {
  const std::int32_t post = surface_.vertex(v).post;
  if (v != kept && post != kNoPost) blocked_[at(post)] = value;
}

bool CollapseTolerance::posts_allow(Index e, const Candidate& candidate) {
  for (const Index end : {surface_.mesh().origin(e), surface_.mesh().target(e)}) {
    if (end != candidate.kept && surface_.vertex(end).post != kNoPost && !is_in_star(end)) {
      return false;
    }
  }
  return surface_.each_new_triangle(e, candidate.kept, [&](Index x, Index y) {
    return holds({&candidate.vertex, &surface_.vertex(x), &surface_.vertex(y)});
  });
}

void CollapseTolerance::note_collapse(Index e, const Candidate& candidate) {
  set_blocked(surface_.mesh().origin(e), candidate.kept, 0);
  set_blocked(surface_.mesh().target(e), candidate.kept, 0);
}

bool CollapseTolerance::allows(Index e, const Candidate& candidate) {
  if (candidate.vertex.post == kNoPost && !agrees_with_its_post(candidate.vertex)) return false;
  // The posts of vertices that go are to be judged as any other.
  note_collapse(e, candidate);
  const bool allowed = posts_allow(e, candidate);
  set_blocked(surface_.mesh().origin(e), candidate.kept, 1);
  set_blocked(surface_.mesh().target(e), candidate.kept, 1);
  return allowed;
}

}  // namespace qmpipe
