#include "stages/greedy/greedy.h"

#include <algorithm>
#include <cmath>
#include <queue>

#include "scheduler/check.h"
#include "stages/surface/array_index.h"
#include "stages/surface/curvature.h"
#include "stages/surface/delaunay.h"

namespace qmpipe {
namespace {

using Index = Delaunay::Index;

struct NextInsertion {
  float error = 0;
  std::int32_t post = -1;
  Index triangle = Delaunay::kNone;
  std::uint32_t version = 0;  // of the triangle; an older one is stale
};

// The worst post first; of equal ones the one with the lowest index.
struct LessUrgent {
  bool operator()(const NextInsertion& a, const NextInsertion& b) const {
    if (a.error != b.error) return a.error < b.error;
    if (a.post != b.post) return a.post > b.post;
    return a.triangle > b.triangle;
  }
};

class GreedyInsertion {
 public:
  GreedyInsertion(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const GreedyOptions& options);
  Tin run();

 private:
  void insert_initial_vertices(const FixedBorders& fixed);
  void insert_post(std::int32_t post, Index near);
  void evaluate(Index triangle);

  const PostGrid& grid_;
  std::span<const float> heights_m_;
  const GreedyOptions& options_;
  PostErrors errors_;
  Delaunay mesh_;
  std::vector<TinVertex> vertices_;
  std::vector<std::uint8_t> blocked_;  // posts that are vertices already or lie on a fixed side
  std::vector<std::uint32_t> versions_;
  std::priority_queue<NextInsertion, std::vector<NextInsertion>, LessUrgent> queue_;
};

GreedyInsertion::GreedyInsertion(const PostGrid& grid, std::span<const float> heights_m,
                                 const FixedBorders& fixed, const GreedyOptions& options)
    : grid_(grid),
      heights_m_(heights_m),
      options_(options),
      errors_(grid, heights_m, options.tolerance_m, options.height_steps, options.curvature),
      mesh_({grid.u_max(), grid.v_max()}),
      blocked_(grid.post_count(), 0) {
  insert_initial_vertices(fixed);
}

void GreedyInsertion::insert_post(std::int32_t post, Index near) {
  const TinVertex vertex = vertex_at_post(grid_, post, heights_m_[at(post)], options_.height_steps);
  const Index inserted = mesh_.insert({vertex.u, vertex.v}, near);
  blocked_[at(post)] = 1;
  if (inserted != static_cast<Index>(vertices_.size())) return;  // was a vertex before
  vertices_.push_back(vertex);
}

void GreedyInsertion::insert_initial_vertices(const FixedBorders& fixed) {
  const std::int32_t i_end = grid_.width_posts - 1;
  const std::int32_t j_end = grid_.height_posts - 1;
  // The triangulation begins with these four, in this order.
  for (const std::int32_t post : {grid_.index(0, 0), grid_.index(i_end, 0),
                                  grid_.index(i_end, j_end), grid_.index(0, j_end)}) {
    vertices_.push_back(vertex_at_post(grid_, post, heights_m_[at(post)], options_.height_steps));
    blocked_[at(post)] = 1;
  }
  const auto last = [this] { return mesh_.touched().empty() ? 0 : mesh_.touched().back(); };
  for (const Side side : kSides) {
    const auto& mask = fixed[index_of(side)];
    if (!mask) continue;
    QMPIPE_CHECK(grid_.width_posts == kTilePosts && grid_.height_posts == kTilePosts);
    QMPIPE_CHECK(mask->test(0) && mask->test(kTileIntervals));
    for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
      const Post p = side_post(side, k);
      if (mask->test(k)) insert_post(grid_.index(p.i, p.j), last());
      blocked_[at(grid_.index(p.i, p.j))] = 1;
    }
  }
  for (const Side side : kSides) {
    if (fixed[index_of(side)] || std::isinf(options_.side_depth_m)) continue;
    const std::int32_t stride = side_stride_posts(grid_, side, options_.side_depth_m);
    for (std::int32_t k = stride; k < kTileIntervals; k += stride) {
      const Post p = side_post(side, k);
      insert_post(grid_.index(p.i, p.j), last());
    }
  }
  const std::int32_t cells = options_.initial_grid_cells;
  for (std::int32_t row = 0; cells > 0 && row <= cells; ++row) {
    for (std::int32_t column = 0; column <= cells; ++column) {
      const std::int32_t post = grid_.index(column * i_end / cells, row * j_end / cells);
      if (blocked_[at(post)] == 0) insert_post(post, last());
    }
  }
}

void GreedyInsertion::evaluate(Index triangle) {
  if (at(triangle) >= versions_.size()) versions_.resize(at(triangle) + 1, 0);
  const std::uint32_t version = ++versions_[at(triangle)];
  PostErrors::Corners corners;
  std::int32_t j_first = grid_.height_posts - 1;
  std::int32_t j_last = 0;
  for (int k = 0; k < 3; ++k) {
    const TinVertex& vertex = vertices_[at(mesh_.vertex(triangle, k))];
    corners[static_cast<std::size_t>(k)] = {.place = {vertex.u, vertex.v},
                                            .height_m = vertex.height_m - errors_.base_m()};
    j_first = std::min(j_first, grid_.row(vertex.post));
    j_last = std::max(j_last, grid_.row(vertex.post));
  }
  Worst worst = errors_.worst_post(corners, j_first, j_last);
  if (worst.error <= errors_.threshold_m()) return;
  // Rarely: a vertex has an error only from the rounding of its place.
  if (blocked_[at(worst.post)] != 0) {
    worst = errors_.worst_free_post(corners, j_first, j_last, blocked_);
    if (worst.error <= errors_.threshold_m()) return;
  }
  queue_.push({worst.error, worst.post, triangle, version});
}

Tin GreedyInsertion::run() {
  for (Index t = 0; t < mesh_.triangle_count(); ++t) evaluate(t);
  while (!queue_.empty() && mesh_.triangle_count() < options_.most_triangles) {
    const NextInsertion next = queue_.top();
    queue_.pop();
    if (next.version != versions_[at(next.triangle)]) continue;
    if (blocked_[at(next.post)] != 0) {
      // A neighbour has inserted this post, and the rounding of its place kept this triangle whole.
      evaluate(next.triangle);
      continue;
    }
    insert_post(next.post, next.triangle);
    for (const Index t : mesh_.touched()) evaluate(t);
    // The rounding of its place may have put the vertex into a neighbour and left this triangle
    // whole, whose other posts would be forgotten.
    if (next.version == versions_[at(next.triangle)]) evaluate(next.triangle);
  }
  Tin tin;
  tin.vertices = std::move(vertices_);
  tin.indices.reserve(3 * at(mesh_.triangle_count()));
  for (Index t = 0; t < mesh_.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      tin.indices.push_back(static_cast<std::uint32_t>(mesh_.vertex(t, k)));
    }
  }
  return tin;
}

}  // namespace

Tin greedy_insertion(const PostGrid& grid, std::span<const float> heights_m,
                     const FixedBorders& fixed, const GreedyOptions& options) {
  return GreedyInsertion(grid, heights_m, fixed, options).run();
}

}  // namespace qmpipe
