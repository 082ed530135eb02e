// Edge collapse: all posts first, then always the edge whose loss is felt least (Lindstrom and Turk
// 1998, memoryless; with the constraints of Campos et al. 2020, section 4.2).
//
// Guarantees: the TIN covers the grid's rectangle, every triangle counter-clockwise in (u, v), which
// is more than the paper's ban on vertical walls; corners stay; on a fixed side exactly the given
// posts are vertices; vertices on the sides are posts with their own heights; heights are multiples
// of the step and lie within the range of the posts' own. With a tolerance every post that is not
// a vertex is within it, measured as greedy insertion does (stages/greedy/post_errors.h), and the end comes
// when no edge can be collapsed into its best place, an end or its middle. Costs and places are
// computed in scaled coordinates (section 4.4.1); equal costs go by the order of the dense TIN's
// triangles, which is that of the posts. Pure: same input, same bits.
//
// At the tolerance at which greedy insertion has 300 to 3000 vertices, on SRTM's Maritime Alps, it
// needs about 0.4 of the triangles (perf/edge_collapse_bench).
#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <span>

#include "stages/greedy/post_errors.h"
#include "stages/surface/tin.h"

namespace qmpipe {

struct EdgeCollapseOptions {
  // Vertex heights are multiples of this (stages/posts/height_step.h).
  HeightSteps height_steps = {};
  // How deep a chord of a free side may sink below the globe.
  double side_depth_m = std::numeric_limits<double>::infinity();
  // Keeps every post within this of the surface; none: least_edges alone decides.
  // REQUIRES: > height_steps.side_m / 2.
  std::optional<double> tolerance_m = std::nullopt;
  Curvature curvature = Curvature::kCounts;
  // The paper's e_e: stops when the TIN has fewer edges than this; 0: not by number.
  std::int64_t least_edges = 0;
  // The paper's e_v, e_b, e_s: weights of volume, boundary and triangle shape.
  double volume_weight = 0.5;
  double boundary_weight = 0.5;
  double shape_weight = 1e-10;
};

// REQUIRES: grid.post_count() finite heights; fixed borders only for a tile's 257 x 257 posts.
Tin edge_collapse(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const EdgeCollapseOptions& options);

}  // namespace qmpipe
