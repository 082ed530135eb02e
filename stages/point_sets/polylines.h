// Polylines over the posts of a grid, simplified together so that none comes to cross or touch
// another (Dyken, Dahlen and Sevaldrud 2009; with errors in space as in Campos et al. 2020, section
// 4.3.1).
//
// The point whose loss is felt least goes first, of equal ones the post with the lowest index. A
// point may go when the triangle between it and its two neighbours holds no vertex of any polyline
// and the new edge is none yet: among edges that do not cross that is the same as that the new edge
// lies in the star of the point in a constrained triangulation. A point that may not go is looked
// at again when a neighbour has gone.
#pragma once

#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "stages/posts/post_grid.h"

namespace qmpipe {

struct Polyline {
  // The first is the last again when closed. Where a post is in several polylines, it stays; the
  // first and the last stay.
  std::vector<std::int32_t> posts;
  // Points go only where the edge in their place is no longer than this, in units of (u, v). 0: all
  // points stay.
  double longest_edge = std::numeric_limits<double>::infinity();
};

// Guarantees: each result is a part of its polyline, in its order; each post that has gone is
// within error_m of the segment in its place, in the metres of flat_scale() and of the heights; no
// two segments cross. Same input, same bits.
// REQUIRES: segments meet only in posts that are both polylines'; grid.post_count() heights.
std::vector<Polyline> simplify_polylines(const PostGrid& grid, std::span<const double> heights_m,
                                         const std::vector<Polyline>& polylines, double error_m);

}  // namespace qmpipe
