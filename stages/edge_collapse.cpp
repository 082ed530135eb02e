#include "stages/edge_collapse.h"

#include "scheduler/check.h"
#include "stages/base_tin.h"
#include "stages/collapse_queue.h"
#include "stages/collapse_surface.h"
#include "stages/collapse_tolerance.h"

namespace qmpipe {
namespace {

using Index = CollapseMesh::Index;
using Candidate = CollapseSurface::Candidate;

class EdgeCollapse {
 public:
  EdgeCollapse(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
               const EdgeCollapseOptions& options)
      : options_(options),
        surface_(grid, base_tin(grid, heights_m, fixed, options.height_step_m), fixed,
                 options.height_step_m,
                 {.volume = options.volume_weight,
                  .boundary = options.boundary_weight,
                  .shape = options.shape_weight}),
        queue_(surface_.mesh().half_edge_count()) {
    if (options.tolerance_m) {
      tolerance_.emplace(grid, heights_m, *options.tolerance_m, options.height_step_m,
                         options.curvature, surface_, fixed);
    }
    const CollapseMesh& mesh = surface_.mesh();
    for (Index e = 0; e < mesh.half_edge_count(); ++e) {
      if (mesh.edge(e) == e) evaluate(e);
    }
  }

  Tin run() {
    while (!queue_.empty() && !is_few_enough()) {
      const Index e = queue_.top().edge;
      const double bound = queue_.top().cost;
      queue_.remove(e);
      const auto candidate = surface_.best(e);
      if (!candidate) continue;
      if (candidate->cost > bound && !queue_.empty() && queue_.top().cost < candidate->cost) {
        queue_.set(e, candidate->cost);
        continue;
      }
      if (is_allowed(e, *candidate)) {
        collapse(e, *candidate);
        continue;
      }
      for (const Candidate& other : surface_.others(e)) {
        if (!is_allowed(e, other)) continue;
        if (!queue_.empty() && queue_.top().cost < other.cost) {
          queue_.set(e, other.cost);
        } else {
          collapse(e, other);
        }
        break;
      }
    }
    return surface_.tin();
  }

 private:
  bool is_few_enough() const {
    return options_.least_edges > 0 && surface_.mesh().edge_count() < options_.least_edges;
  }

  bool is_allowed(Index e, const Candidate& candidate) {
    return surface_.fits(e, candidate) && (!tolerance_ || tolerance_->allows(e, candidate));
  }

  void evaluate(Index e) {
    const auto candidate = surface_.best(e);
    if (candidate) {
      queue_.set(e, candidate->cost);
    } else {
      queue_.remove(e);
    }
  }

  void collapse(Index e, const Candidate& candidate) {
    const CollapseMesh& mesh = surface_.mesh();
    for (const Index h : {e, mesh.twin(e)}) {
      if (h == CollapseMesh::kNone) continue;
      for (Index k = h - h % 3; k < h - h % 3 + 3; ++k) queue_.remove(mesh.edge(k));
    }
    if (tolerance_) tolerance_->note_collapse(e, candidate);
    const Index v = surface_.collapse(e, candidate);
    static const bool lazy = getenv("LAZY") != nullptr;
    mesh.each_leaving(v, [&](Index k) {
      evaluate(mesh.edge(k));
      if (mesh.on_hull(CollapseMesh::previous(k))) evaluate(CollapseMesh::previous(k));
    });
    mesh.each_neighbour(v, [&](Index w) {
      const auto look = [&](Index k) {
        if (mesh.origin(k) == v || mesh.target(k) == v) return;
        if (!lazy || !queue_.contains(mesh.edge(k))) evaluate(mesh.edge(k));
      };
      mesh.each_leaving(w, [&](Index k) {
        look(k);
        if (mesh.on_hull(CollapseMesh::previous(k))) look(CollapseMesh::previous(k));
      });
    });
  }

  const EdgeCollapseOptions& options_;
  CollapseSurface surface_;
  std::optional<CollapseTolerance> tolerance_;
  CollapseQueue queue_;
};

}  // namespace

Tin edge_collapse(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const EdgeCollapseOptions& options) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  return EdgeCollapse(grid, heights_m, fixed, options).run();
}

}  // namespace qmpipe
