#include "stages/edge_collapse/lindstrom_turk.h"

#include <cmath>

namespace qmpipe {
namespace {

// Up to three planes in which the vertex must lie. A plane that is within one degree of what is known
// already would determine nothing but rounding errors, so it does not count.
class Constraints {
 public:
  bool complete() const { return count_ == 3; }

  void add(const Vector3& normal, double offset) {
    const double squared = dot(normal, normal);
    if (complete() || !(squared > 0) || !std::isfinite(squared)) return;
    if (count_ == 1) {
      const double along = dot(normals_[0], normal);
      if (along * along > squares_[0] * squared * kSquaredCosine) return;
    }
    if (count_ == 2) {
      const Vector3 line = cross(normals_[0], normals_[1]);
      const double along = dot(line, normal);
      if (along * along <= dot(line, line) * squared * kSquaredSine) return;
    }
    normals_[count_] = normal;
    offsets_[count_] = offset;
    squares_[count_] = squared;
    ++count_;
  }

  // The lowest place of x' h x - 2 slope * x in what the planes so far leave free.
  void add_minimum(const Symmetric3& h, const Vector3& slope) {
    const double size = h.xx + h.yy + h.zz;
    const auto add_along = [&](const Vector3& free) {
      const Vector3 normal = h.times(free);
      // On a plane nothing is left but rounding errors, which point anywhere.
      if (dot(normal, normal) <= kSquaredNoise * size * size * dot(free, free)) return;
      add(normal, dot(free, slope));
    };
    if (count_ == 0) {
      add_along({1, 0, 0});
      add_along({0, 1, 0});
      add_along({0, 0, 1});
    } else if (count_ == 1) {
      const Vector3 normal = normals_[0];
      const Vector3 free = across(normal);
      add_along(free);
      add_along(cross(normal, free));
    } else if (count_ == 2) {
      add_along(cross(normals_[0], normals_[1]));
    }
  }

  std::optional<Vector3> solution() const {
    if (!complete()) return std::nullopt;
    const Vector3 bc = cross(normals_[1], normals_[2]);
    const double determinant = dot(normals_[0], bc);
    const Vector3 sum = offsets_[0] * bc + offsets_[1] * cross(normals_[2], normals_[0]) +
                        offsets_[2] * cross(normals_[0], normals_[1]);
    const Vector3 x = 1 / determinant * sum;
    if (!std::isfinite(x.x) || !std::isfinite(x.y) || !std::isfinite(x.z)) return std::nullopt;
    return x;
  }

 private:
  static constexpr double kSquaredCosine = 0.99969541350954788;  // of one degree
  static constexpr double kSquaredNoise = 1e-26;
  static constexpr double kSquaredSine = 0.00030458649045211894;

  // A direction in the plane: across the axis that the normal is nearest to.
  static Vector3 across(const Vector3& n) {
    const double x = std::abs(n.x);
    const double y = std::abs(n.y);
    const double z = std::abs(n.z);
    if (z > x && z > y) return {n.z, 0, -n.x};
    if (y > x) return {0, -n.z, n.y};
    return {-n.z, 0, n.x};
  }

  Vector3 normals_[3];
  double offsets_[3] = {0, 0, 0};
  double squares_[3] = {0, 0, 0};  // of the normals' lengths
  int count_ = 0;
};

}  // namespace

// The target's planes are moved to the origin's place; those of the edge's own triangles pass through
// both and need no moving, but were counted twice.
EdgeQuadric::EdgeQuadric(const StarSums& origin, const StarSums& target, const Vector3& along,
                         std::span<const EdgeTriangle> shared)
    : squared_length_(dot(along, along)),
      normals_(origin.normals + target.normals),
      volume_(dot(target.normals, along)),
      planes_(origin.planes + target.planes),
      slope_(target.planes.times(along)),
      constant_(dot(along, slope_)),
      link_(origin.neighbours + target.neighbours + (target.degree - 1) * along),
      link_squares_(origin.squared_distances + target.squared_distances +
                    2 * dot(along, target.neighbours) + (target.degree - 1) * squared_length_),
      link_size_(origin.degree + target.degree - 2) {
  for (const EdgeTriangle& triangle : shared) {
    normals_ = normals_ - triangle.normal;
    planes_.add_outer(-1, triangle.normal);
    link_ = link_ - triangle.tip;
    link_squares_ -= dot(triangle.tip, triangle.tip);
    link_size_ -= 1;
  }
}

std::optional<Vector3> EdgeQuadric::best_place() const {
  Constraints constraints;
  constraints.add(normals_, volume_);
  constraints.add_minimum(planes_, slope_);
  if (!constraints.complete()) {
    const Symmetric3 shape = {.xx = link_size_, .yy = link_size_, .zz = link_size_};
    constraints.add_minimum(shape, link_);
  }
  return constraints.solution();
}

double EdgeQuadric::cost(const Vector3& place, double boundary,
                         const CollapseWeights& weights) const {
  const double volume =
      (dot(place, planes_.times(place)) - 2 * dot(place, slope_) + constant_) / 36;
  const double shape = link_size_ * dot(place, place) - 2 * dot(place, link_) + link_squares_;
  return weights.volume * (volume > 0 ? volume : 0) +
         squared_length_ * (weights.boundary * boundary + weights.shape * squared_length_ * shape);
}

}  // namespace qmpipe
