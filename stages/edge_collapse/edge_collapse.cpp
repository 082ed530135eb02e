#include "stages/edge_collapse/edge_collapse.h"

#include <limits>

#include "scheduler/check.h"
#include "stages/edge_collapse/collapse_queue.h"
#include "stages/edge_collapse/collapse_surface.h"
#include "stages/edge_collapse/collapse_tolerance.h"
#include "stages/surface/array_index.h"
#include "stages/surface/base_tin.h"

namespace qmpipe {
namespace {

using Index = CollapseMesh::Index;
using Candidate = CollapseSurface::Candidate;

// Costs are kept up to date where a collapse has changed most, on the edges of its vertex. Those
// farther out are computed again when their turn comes, and wait on when they have become dearer;
// one that has become cheaper comes too late, until the next round. On SRTM tiles the error at equal
// numbers of edges is within 1 % of computing them all each time, which takes twice as long.
class EdgeCollapse {
 public:
  EdgeCollapse(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
               const EdgeCollapseOptions& options)
      : options_(options),
        surface_(grid, base_tin(grid, heights_m, fixed, options.height_steps), fixed,
                 options.height_steps, options.side_depth_m,
                 {.volume = options.volume_weight,
                  .boundary = options.boundary_weight,
                  .shape = options.shape_weight}) {
    if (options.tolerance_m) {
      tolerance_.emplace(grid, heights_m, *options.tolerance_m, options.height_steps,
                         options.curvature, surface_, fixed);
    }
    start_round();
  }

  Tin run() {
    while (!queue_.empty() && !is_few_enough()) {
      const CollapseQueue::Entry next = queue_.top();
      queue_.remove(next.edge);
      const auto candidate = surface_.best(next.edge);
      if (!candidate || is_to_wait(next, candidate->cost)) continue;
      if (is_allowed(next.edge, *candidate)) {
        collapse(next.edge, *candidate);
      } else {
        collapse_otherwise(next);
      }
      if (surface_.mesh().triangle_count() < round_end_) {
        surface_.compact();
        start_round();
      }
    }
    return surface_.tin();
  }

 private:
  // A round ends when half of the triangles have gone. What is left then moves together in memory,
  // which the time depends on more than on arithmetic, and every cost is computed anew.
  static constexpr std::int64_t kFewTriangles = 2000;
  void start_round() {
    const CollapseMesh& mesh = surface_.mesh();
    queue_ = CollapseQueue(mesh.half_edge_count());
    has_refused_.assign(at(mesh.vertex_count()), 0);
    for (Index e = 0; e < mesh.half_edge_count(); ++e) {
      if (mesh.edge(e) == e) evaluate(e);
    }
    round_end_ = mesh.triangle_count() > kFewTriangles ? mesh.triangle_count() / 2 : 0;
  }

  bool is_few_enough() const {
    return options_.least_edges > 0 && surface_.mesh().edge_count() < options_.least_edges;
  }

  bool is_allowed(Index e, const Candidate& candidate) {
    return surface_.fits(e, candidate) && (!tolerance_ || tolerance_->allows(e, candidate));
  }

  bool is_to_wait(const CollapseQueue::Entry& entry, double cost) {
    if (cost <= entry.cost || queue_.empty() || queue_.top().cost >= cost) return false;
    queue_.set(entry.edge, cost);
    return true;
  }

  // An edge that cannot become its best vertex, and none of the others either, is out of the queue
  // until something changes around it.
  void collapse_otherwise(const CollapseQueue::Entry& entry) {
    const Index e = entry.edge;
    for (const Candidate& other : surface_.others(e)) {
      if (!is_allowed(e, other)) continue;
      if (!is_to_wait(entry, other.cost)) collapse(e, other);
      return;
    }
    has_refused_[at(surface_.mesh().origin(e))] = 1;
    has_refused_[at(surface_.mesh().target(e))] = 1;
  }

  void evaluate(Index e) {
    const auto cost = surface_.cost(e);
    if (cost) {
      queue_.set(e, *cost);
    } else {
      queue_.remove(e);
    }
  }

  void collapse(Index e, const Candidate& candidate) {
    const CollapseMesh& mesh = surface_.mesh();
    for (const Index h : {e, mesh.twin(e)}) {
      if (h == CollapseMesh::kNone) continue;
      // Edges go by their lower half-edge, which may be one that dies.
      for (Index k = h - h % 3; k < h - h % 3 + 3; ++k) queue_.remove(mesh.edge(k));
    }
    if (tolerance_) tolerance_->note_collapse(e, candidate);
    const Index v = surface_.collapse(e, candidate);
    mesh.each_edge(v, [&](Index k) { evaluate(k); });
    has_refused_[at(v)] = 0;
    mesh.each_neighbour(v, [&](Index w) {
      if (has_refused_[at(w)] == 0) return;
      has_refused_[at(w)] = 0;
      mesh.each_edge(w, [&](Index k) {
        if (!queue_.contains(k)) evaluate(k);
      });
    });
  }

  const EdgeCollapseOptions& options_;
  CollapseSurface surface_;
  std::optional<CollapseTolerance> tolerance_;
  CollapseQueue queue_;
  std::vector<std::uint8_t> has_refused_;  // vertices at which an edge may be out of the queue
  std::int64_t round_end_ = 0;
};

}  // namespace

Tin edge_collapse(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const EdgeCollapseOptions& options) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  // Half-edges have 32-bit numbers.
  QMPIPE_CHECK(grid.post_count() < std::numeric_limits<Index>::max() / 6);
  return EdgeCollapse(grid, heights_m, fixed, options).run();
}

}  // namespace qmpipe
