// Whether a collapse keeps every post within the tolerance, as stages/greedy/post_errors.h measures it.
//
// Guarantees: when the first TIN kept the posts within it that are no vertices, so does every TIN
// that allowed collapses lead to, wherever the rounding of vertices puts posts. Posts of fixed sides
// are a neighbour's and do not count.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/edge_collapse/collapse_surface.h"
#include "stages/greedy/post_errors.h"

namespace qmpipe {

class CollapseTolerance {
 public:
  using Index = CollapseSurface::Index;
  using Candidate = CollapseSurface::Candidate;

  // REQUIRES: those of PostErrors; `surface` outlives this.
  CollapseTolerance(const PostGrid& grid, std::span<const float> heights_m, double tolerance_m,
                    const HeightSteps& height_steps, Curvature curvature,
                    const CollapseSurface& surface, const FixedBorders& fixed);

  bool allows(Index e, const Candidate& candidate);
  // To be told of a collapse before it is made.
  void note_collapse(Index e, const Candidate& candidate);

 private:
  // The rows of posts next to a vertex: twice its own where it is one.
  struct Rows {
    std::int32_t below = 0;
    std::int32_t above = 0;
  };
  Rows rows_of(const TinVertex& vertex) const;
  PostErrors::Corner corner(const TinVertex& vertex) const;
  bool posts_allow(Index e, const Candidate& candidate);
  bool holds(const std::array<const TinVertex*, 3>& triangle);
  bool agrees_with_its_post(const TinVertex& vertex) const;
  bool is_in_star(Index v) const;
  void set_blocked(Index v, Index kept, std::uint8_t value);

  const PostGrid& grid_;
  const CollapseSurface& surface_;
  PostErrors errors_;
  std::vector<std::uint8_t> blocked_;  // posts that are vertices or lie on a fixed side
};

}  // namespace qmpipe
