// Walks the posts that lie in a triangle of a tile, row by row, and evaluates planes on them.
//
// Posts are visited at their exact place (PostGrid::u_exact, v_exact), which is where they lie on
// the globe; triangles have corners in whole quantized units. `margin` widens the triangle by that
// many quantized units on every side: with a margin of 1 every post is visited by each triangle
// that may hold it whatever the rounding, with a tiny one by exactly one triangle, or by both
// where it lies on their common edge.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstdint>

#include "stages/posts/post_grid.h"
#include "stages/surface/delaunay.h"

namespace qmpipe {

// A tiny margin: it only covers the rounding of double arithmetic.
inline constexpr double kRoundingMargin = 1e-6;

// value = at_origin + du * u + dv * v over the quantized frame.
struct Plane {
  double at_origin = 0;
  double du = 0;
  double dv = 0;
  double at(double u, double v) const { return at_origin + du * u + dv * v; }
};

// The plane through three corners with values za, zb, zc. REQUIRES: abc not collinear.
inline Plane plane_through(const IntPoint& a, const IntPoint& b, const IntPoint& c, double za,
                           double zb, double zc) {
  const double scale = 1.0 / static_cast<double>(orientation(a, b, c));
  Plane plane;
  plane.du = ((zb - za) * (c.y - a.y) - (zc - za) * (b.y - a.y)) * scale;
  plane.dv = ((zc - za) * (b.x - a.x) - (zb - za) * (c.x - a.x)) * scale;
  plane.at_origin = za - plane.du * a.x - plane.dv * a.y;
  return plane;
}

namespace detail {
// One edge as a bound on u at a given v: u <= at_zero + slope * v, or >= for a left bound.
struct EdgeBound {
  double at_zero = 0;
  double slope = 0;
  double at(double v) const { return at_zero + slope * v; }
};
}  // namespace detail

// The rows of posts between the lowest and the highest corner.
struct PostRows {
  std::int32_t first = 0;
  std::int32_t last = 0;
};
inline PostRows rows_of_triangle(const PostGrid& grid, const IntPoint& a, const IntPoint& b,
                                 const IntPoint& c, double margin) {
  const auto row_of = [&grid](double v) {
    const auto it = std::lower_bound(grid.v_exact.begin(), grid.v_exact.end(), v);
    return static_cast<std::int32_t>(it - grid.v_exact.begin());
  };
  return {.first = row_of(std::min({a.y, b.y, c.y}) - margin),
          .last = std::min(grid.height_posts - 1, row_of(std::max({a.y, b.y, c.y}) + margin))};
}

// Calls row(j, i_first, i_last) for every row with posts of the counter-clockwise triangle abc in
// it, rows ascending. Only rows j_first..j_last are looked at: pass the rows of the triangle's
// lowest and highest corner where they are known, else 0 and 256.
template <class Row>
void scan_triangle(const PostGrid& grid, const IntPoint& a, const IntPoint& b, const IntPoint& c,
                   double margin, std::int32_t j_first, std::int32_t j_last, const Row& row) {
  detail::EdgeBound left[3];
  detail::EdgeBound right[3];
  int left_count = 0;
  int right_count = 0;
  const auto add_edge = [&](const IntPoint& from, const IntPoint& to) {
    if (from.y == to.y) return;
    const double slope = static_cast<double>(to.x - from.x) / (to.y - from.y);
    const double outward = margin * std::sqrt(1 + slope * slope);
    const double at_zero = from.x - slope * from.y;
    if (to.y > from.y) {
      right[right_count++] = {at_zero + outward, slope};
    } else {
      left[left_count++] = {at_zero - outward, slope};
    }
  };
  add_edge(a, b);
  add_edge(b, c);
  add_edge(c, a);
  if (left_count == 1) left[left_count++] = left[0];
  if (right_count == 1) right[right_count++] = right[0];

  const double columns_per_u = grid.columns_per_u();
  const double u_low = std::min({a.x, b.x, c.x}) - margin;
  const double u_high = std::max({a.x, b.x, c.x}) + margin;
  const double v_low = std::min({a.y, b.y, c.y}) - margin;
  const double v_high = std::max({a.y, b.y, c.y}) + margin;
  for (std::int32_t j = j_first; j <= j_last; ++j) {
    const double v = grid.v_exact[static_cast<std::size_t>(j)];
    if (v < v_low || v > v_high) continue;
    const double from = std::max({left[0].at(v), left[1].at(v), u_low});
    const double to = std::min({right[0].at(v), right[1].at(v), u_high});
    // from and to are within the tile widened by the margin, so truncation is safe after the shift.
    const auto i_first = std::max(0, static_cast<std::int32_t>(std::ceil(from * columns_per_u)));
    const auto i_last =
        std::min(grid.width_posts - 1, static_cast<std::int32_t>(std::floor(to * columns_per_u)));
    if (i_first <= i_last) row(j, i_first, i_last);
  }
}

}  // namespace qmpipe
