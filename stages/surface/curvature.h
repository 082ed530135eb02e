// How far a flat triangle sinks below the globe.
//
// A client draws a triangle as a chord of the ellipsoid. Near a post at latitude f the ellipsoid
// bends away as R/2 * (df^2 + cos^2(f) * dl^2), so the depth of a chord at the post is the
// difference between that quadratic interpolated over the triangle and its value at the post. The
// two squares are kept apart, because the factor cos^2(f) belongs to the post and not to the
// corners: interpolate each linearly, then combine. Good to a few per cent for triangles up to
// about 10 degrees; larger ones are far beyond any tolerance whatever the formula (Campos et al.
// 2020, section 4.4.4 puts a regular grid there instead).
#pragma once

#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "stages/posts/post_grid.h"

namespace qmpipe {

// Squares of angles in radians from the tile's centre, by column and row of posts.
struct CurvatureTerms {
  std::vector<double> longitude_squared;
  std::vector<double> latitude_squared;
  std::vector<double> parallel_scale;  // cos^2 of the row's latitude
  double metres_per_unit = 0;          // -R/2
  double width_rad = 0;
  double height_rad = 0;

  // The squares at a place of the quantized frame: a vertex counts where the file puts it, half a
  // unit from its post, which in a wide tile is hundreds of metres of the squares' slope.
  double longitude_squared_at(double u) const { return squared_from_middle(u, width_rad); }
  double latitude_squared_at(double v) const { return squared_from_middle(v, height_rad); }

  double at(std::int32_t i, std::int32_t j) const {
    const auto row = static_cast<std::size_t>(j);
    return metres_per_unit * (latitude_squared[row] +
                              parallel_scale[row] * longitude_squared[static_cast<std::size_t>(i)]);
  }

 private:
  static double squared_from_middle(double quantized, double extent_rad) {
    const double angle_rad = (quantized / kQuantizedMax - 0.5) * extent_rad;
    return angle_rad * angle_rad;
  }
};

// REQUIRES: the grid of a tile.
CurvatureTerms curvature_terms(const PostGrid& grid);

// How many posts a chord of a side may span, a power of two of at most 256, to sink no deeper than this
// below the globe; 1 where no chord is as shallow. 256 on a plane. REQUIRES: the grid of a tile.
std::int32_t side_stride_posts(const PostGrid& grid, Side side, double deepest_m);

// The depth of the tile's longest chord in metres: an upper bound for any triangle in it.
// 0 on a plane.
double largest_sagitta_m(const PostGrid& grid);

}  // namespace qmpipe
