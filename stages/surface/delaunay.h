// Incremental Delaunay triangulation of a rectangle, exact in integer arithmetic.
//
// Notation: triangle t has half-edges 3t, 3t+1, 3t+2; half-edge e runs from origin(e) to the origin
// of the next one, counter-clockwise, and twin(e) runs the other way in the neighbour (-1 on the
// hull). Points are integers in 0..32767, so orientation fits 32 bits and the in-circle determinant
// 64: each of its three terms is at most 2^30 (twice a triangle's area inside the rectangle) times
// 2^31 (a squared distance), and 3 * 2^61 < 2^63.
//
// Guarantees: after every insertion the triangles cover the rectangle exactly once, all
// counter-clockwise with positive area, and no vertex lies strictly inside a circumcircle. The
// result depends on the points and the order of insertion alone.
// Source: Guibas and Stolfi 1985; Lawson's flips as in Garland and Heckbert 1995, section 4.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace qmpipe {

struct IntPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
  friend constexpr bool operator==(const IntPoint&, const IntPoint&) = default;
};

// Twice the signed area of abc: positive when counter-clockwise.
constexpr std::int64_t orientation(const IntPoint& a, const IntPoint& b, const IntPoint& c) {
  return static_cast<std::int64_t>(b.x - a.x) * (c.y - a.y) -
         static_cast<std::int64_t>(b.y - a.y) * (c.x - a.x);
}

// True when d lies strictly inside the circle through a, b, c. REQUIRES: abc counter-clockwise.
bool in_circle(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d);

class Delaunay {
 public:
  using Index = std::int32_t;
  static constexpr Index kNone = -1;

  // The rectangle from (0, 0) to `size` with its corners as vertices 0 (south-west), 1 (south-east),
  // 2 (north-east), 3 (north-west) and two triangles. REQUIRES: 1 <= size.x, size.y <= 32767.
  explicit Delaunay(const IntPoint& size, std::size_t expected_vertices = 1024);

  // Adds a point of the rectangle and returns its vertex. `near` is a triangle to start the search
  // from. A point that is a vertex already is not added again; its vertex is returned and
  // touched() is empty.
  Index insert(const IntPoint& point, Index near);
  // The triangles that the last insertion made or changed, each once.
  std::span<const Index> touched() const { return touched_; }

  Index triangle_count() const { return static_cast<Index>(origin_.size() / 3); }
  Index vertex_count() const { return static_cast<Index>(points_.size()); }
  const IntPoint& point(Index vertex) const { return points_[at(vertex)]; }
  // Vertex k (0..2) of triangle t.
  Index vertex(Index t, int k) const { return origin_[at(3 * t + k)]; }
  // The triangle across the edge from vertex k to vertex k+1 of t, or kNone on the hull.
  Index across(Index t, int k) const {
    const Index e = twin_[at(3 * t + k)];
    return e == kNone ? kNone : e / 3;
  }
  // A triangle that contains the point (on its border counts), found by walking from `near`.
  Index locate(const IntPoint& point, Index near) const;

 private:
  static std::size_t at(Index i) { return static_cast<std::size_t>(i); }
  static Index next(Index e) { return e % 3 == 2 ? e - 2 : e + 1; }
  static Index previous(Index e) { return e % 3 == 0 ? e + 2 : e - 1; }
  const IntPoint& origin_point(Index e) const { return points_[at(origin_[at(e)])]; }

  Index add_triangle(Index a, Index b, Index c);
  void set_triangle(Index t, Index a, Index b, Index c);
  void link(Index e, Index f);
  void split_triangle(Index t, Index p);
  void split_edge(Index e, Index p);
  void legalize();
  void flip(Index e);
  void touch(Index t);

  std::vector<IntPoint> points_;
  std::vector<Index> origin_;
  std::vector<Index> twin_;
  std::vector<Index> pending_;  // half-edges opposite the new point, to be tested
  std::vector<Index> touched_;
  std::vector<std::uint32_t> stamp_;  // the insertion that touched each triangle last
  std::uint32_t insertion_ = 0;
};

}  // namespace qmpipe
