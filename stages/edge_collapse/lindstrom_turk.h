// Cost and place of the vertex that an edge collapses into, after Lindstrom and Turk, "Fast and
// memory efficient polygonal simplification" (1998): the place keeps the volume, then loses least
// of it, then makes the best shaped triangles; the cost is the squared volume lost.
//
// Everything about an edge comes from sums over the stars of its two ends, each kept relative to the
// end's own place: a star's triangles all pass through it, so that their planes' constants vanish,
// and nothing is lost by cancellation on nearly flat terrain. Agrees with CGAL's policies of that
// name (tests/stages/edge_collapse/edge_collapse_cgal_test.cpp).
#pragma once

#include <cstdint>
#include <optional>
#include <span>

namespace qmpipe {

struct Vector3 {
  double x = 0;
  double y = 0;
  double z = 0;

  Vector3& operator+=(const Vector3& b) {
    x += b.x;
    y += b.y;
    z += b.z;
    return *this;
  }
  friend Vector3 operator+(Vector3 a, const Vector3& b) { return a += b; }
  friend Vector3 operator-(const Vector3& a, const Vector3& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
  }
  friend Vector3 operator*(double f, const Vector3& a) { return {f * a.x, f * a.y, f * a.z}; }
};
inline double dot(const Vector3& a, const Vector3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vector3 cross(const Vector3& a, const Vector3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A symmetric matrix, as a sum of squares of planes is one.
struct Symmetric3 {
  double xx = 0;
  double xy = 0;
  double xz = 0;
  double yy = 0;
  double yz = 0;
  double zz = 0;

  // Adds factor * n n^T.
  void add_outer(double factor, const Vector3& n) {
    const Vector3 f = factor * n;
    xx += f.x * n.x;
    xy += f.x * n.y;
    xz += f.x * n.z;
    yy += f.y * n.y;
    yz += f.y * n.z;
    zz += f.z * n.z;
  }
  friend Symmetric3 operator+(const Symmetric3& a, const Symmetric3& b) {
    return {a.xx + b.xx, a.xy + b.xy, a.xz + b.xz, a.yy + b.yy, a.yz + b.yz, a.zz + b.zz};
  }
  Vector3 times(const Vector3& a) const {
    return {xx * a.x + xy * a.y + xz * a.z, xy * a.x + yy * a.y + yz * a.z,
            xz * a.x + yz * a.y + zz * a.z};
  }
};

struct CollapseWeights {
  double volume = 0.5;
  double boundary = 0.5;
  double shape = 1e-10;
};

// What is known of a vertex: over its triangles the normals (twice the area long) and their outer
// products, over its neighbours their places less its own.
struct StarSums {
  Vector3 normals;
  Symmetric3 planes;
  Vector3 neighbours;
  double squared_distances = 0;
  double degree = 0;

  void add_triangle(const Vector3& normal) {
    normals += normal;
    planes.add_outer(1, normal);
  }
  void add_neighbour(const Vector3& offset) {
    neighbours += offset;
    squared_distances += dot(offset, offset);
    degree += 1;
  }
};

// A triangle of the edge itself: its normal, and the place across the edge less the origin's.
struct EdgeTriangle {
  Vector3 normal;
  Vector3 tip;
};

// The sums of one edge; places are relative to its origin.
class EdgeQuadric {
 public:
  // `along`: target less origin. REQUIRES: the one or two triangles of the edge.
  EdgeQuadric(const StarSums& origin, const StarSums& target, const Vector3& along,
              std::span<const EdgeTriangle> shared);

  // Where the vertex should be; none when nothing determines it. Knows of no hull.
  std::optional<Vector3> best_place() const;
  // What it costs to put it there. `boundary`: a quarter of the sum, over hull edges at the ends, of
  // the squared areas that they sweep.
  double cost(const Vector3& place, double boundary, const CollapseWeights& weights) const;

 private:
  double squared_length_ = 0;
  Vector3 normals_;  // volume: normals_ * x = volume_ keeps it
  double volume_ = 0;
  Symmetric3 planes_;  // volume lost, squared: x' planes_ x - 2 slope_ * x + constant_
  Vector3 slope_;
  double constant_ = 0;
  Vector3 link_;  // over the vertices around: sum of places, of their squares, number
  double link_squares_ = 0;
  double link_size_ = 0;
};

}  // namespace qmpipe
