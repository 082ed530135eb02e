#include "pipeline/common/nearest_grid.h"

#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {

// Written out here, because they are the inner loop and geodesy's are calls.
Vec3 from_to(const Vec3& a, const Vec3& b) { return {b[0] - a[0], b[1] - a[1], b[2] - a[2]}; }
double inner(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
Vec3 outer(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}

double squared_distance_to_edge(const Vec3& p, const Vec3& a, const Vec3& b) {
  const Vec3 along = from_to(a, b);
  const double squared = inner(along, along);
  const double t = squared > 0 ? std::clamp(inner(from_to(a, p), along) / squared, 0.0, 1.0) : 0;
  return squared_distance(p, Vec3{a[0] + t * along[0], a[1] + t * along[1], a[2] + t * along[2]});
}

}  // namespace

double squared_distance(const Vec3& p, const Triangle& triangle) {
  const Vec3 ab = from_to(triangle[0], triangle[1]);
  const Vec3 ac = from_to(triangle[0], triangle[2]);
  const Vec3 ap = from_to(triangle[0], p);
  const Vec3 normal = outer(ab, ac);
  const double squared = inner(normal, normal);
  if (squared > 0) {
    const double weight_b = inner(outer(ap, ac), normal);
    const double weight_c = inner(outer(ab, ap), normal);
    if (weight_b >= 0 && weight_c >= 0 && weight_b + weight_c <= squared) {
      const double above = inner(ap, normal);
      return above * above / squared;
    }
  }
  return std::min({squared_distance_to_edge(p, triangle[0], triangle[1]),
                   squared_distance_to_edge(p, triangle[1], triangle[2]),
                   squared_distance_to_edge(p, triangle[2], triangle[0])});
}

GroundFrame::GroundFrame(std::span<const Vec3> points_ecef) {
  Vec3 sum{};
  for (const Vec3& p : points_ecef) sum = plus(sum, p);
  origin_ = scaled(sum, 1 / static_cast<double>(points_ecef.size()));
  const Vec3 east = cross({0, 0, 1}, origin_);
  if (length(east) == 0) return;
  axes_[0] = unit(east);
  axes_[1] = unit(cross(origin_, axes_[0]));
  axes_[2] = cross(axes_[0], axes_[1]);
}

std::vector<Vec3> GroundFrame::turned(std::span<const Vec3> points_ecef) const {
  std::vector<Vec3> points;
  points.reserve(points_ecef.size());
  for (const Vec3& p : points_ecef) {
    const Vec3 from_origin = from_to(origin_, p);
    points.push_back(
        {inner(from_origin, axes_[0]), inner(from_origin, axes_[1]), inner(from_origin, axes_[2])});
  }
  return points;
}

}  // namespace qmpipe
