// Point-set simplification: borders and sharp edges as polylines that are simplified together, the
// remaining posts as points without connectivity, all of them triangulated again (Campos et al.
// 2020, section 4.3).
//
// Guarantees: the TIN covers the grid's rectangle, every triangle counter-clockwise in (u, v); corners
// stay; on a fixed side exactly the given posts are vertices; vertices on the sides are posts with
// their own heights; on a free side no edge is longer than longest_border_edge_percent of it, or
// than one post spacing; simplified polylines are edges of the TIN, or rows of edges on one line in
// (u, v), and do not cross; heights are multiples of the step and lie within the range of the
// posts' own. Only WLOP makes vertices that are no posts; its heights follow the globe
// (stages/point_sets/wlop.h). There is no bound on the vertical error. Vertices come by v, then u. Random
// choices come from the seed alone. Pure: same input and seed, same bits. Safe from several threads.
#pragma once

#include <cstdint>
#include <limits>
#include <span>

#include "stages/surface/tin.h"

namespace qmpipe {

enum class PointSetMethod {
  kRandom,     // removes a share of the points at random
  kGrid,       // keeps a random point of each cell of a regular grid
  kHierarchy,  // keeps the middle of clusters, split until they are small and flat (Pauly 2002)
  kWlop,       // weighted locally optimal projection: evens out and smooths (Huang 2009)
};

struct PointSetOptions {
  PointSetMethod method = PointSetMethod::kRandom;
  // Vertex heights are multiples of this (stages/posts/height_step.h).
  HeightSteps height_steps = {};
  // How deep a chord of a free side may sink below the globe.
  double side_depth_m = std::numeric_limits<double>::infinity();
  std::uint64_t seed = 0;
  // Polylines. p_e: largest distance in metres, in space, of a removed point from the segment in its
  // place.
  double polyline_error_m = 1;
  // p_b: of the side's length in (u, v).
  double longest_border_edge_percent = 10;
  // p_m: sharp polylines of fewer points do not count; their points are points as all others.
  std::int32_t least_polyline_points = 25;
  // Edges whose triangles' normals are farther apart than this, in scaled coordinates, are sharp.
  double sharp_angle_deg = 60;
  // r_r: of the points that are no polyline's.
  double removed_percent = 75;
  // d_g
  double cell_size_m = 488.28;
  // h_c: most points of a cluster; h_v: largest surface variation of one, 0 to 1/3.
  std::int32_t cluster_size = 50;
  double surface_variation = 0.001;
  // w_p, w_r, w_i
  double retained_percent = 25;
  double neighbour_radius_m = 5;
  std::int32_t iterations = 15;
};

// Distances between points are taken in ECEF on the globe (section 4.4.1), else in the plane's metres.
// REQUIRES: grid.post_count() finite heights; fixed borders only for a tile's 257 x 257 posts;
// percentages 0..100; sizes > 0; the variation and the number of iterations >= 0.
Tin simplify_point_set(const PostGrid& grid, std::span<const float> heights_m,
                       const FixedBorders& fixed, const PointSetOptions& options);

}  // namespace qmpipe
