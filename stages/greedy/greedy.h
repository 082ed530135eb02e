// Greedy insertion: the coarsest TIN first, then always the worst post (Garland and Heckbert 1995;
// Campos et al. 2020, sections 4.1 and 4.4.4).
//
// Guarantees: the TIN covers the grid's rectangle; its corners are vertices; on a fixed side exactly
// the given posts are vertices; every post that is not a vertex is within `tolerance_m` of the
// surface that the file will decode to (vertex heights snapped to `height_steps`, corners of
// triangles at their quantized places, posts at their exact ones). With `Curvature::kCounts` the
// globe's curvature is part of the error: a triangle is a chord, and a chord sinks below the
// ellipsoid; both the height error alone and the two together are within the tolerance.
// Ties are broken by the post's index. Pure: same input, same bits.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "stages/greedy/post_errors.h"
#include "stages/surface/tin.h"

namespace qmpipe {

struct GreedyOptions {
  // The zoom's tolerance g(z), the paper's g_e. REQUIRES: > height_steps.side_m / 2.
  double tolerance_m = 0;
  // Vertex heights are multiples of this (stages/posts/height_step.h).
  HeightSteps height_steps = {};
  // How deep a chord of a free side may sink below the globe.
  double side_depth_m = std::numeric_limits<double>::infinity();
  // The paper's g_g: a regular grid of this many cells a side is inserted first; 0 for none.
  std::int32_t initial_grid_cells = 0;
  Curvature curvature = Curvature::kCounts;
  // Stops here, or one triangle later, whatever the tolerance says.
  std::int32_t most_triangles = std::numeric_limits<std::int32_t>::max();
};

// REQUIRES: grid.post_count() finite heights; fixed borders only for a tile's 257 x 257 posts.
Tin greedy_insertion(const PostGrid& grid, std::span<const float> heights_m,
                     const FixedBorders& fixed, const GreedyOptions& options);

}  // namespace qmpipe
