#include "stages/detail_model/simplify.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/edge_collapse/collapse_queue.h"
#include "stages/surface/array_index.h"

namespace qmpipe {
namespace {

using Index = CollapseMesh::Index;
using Position = std::array<double, 3>;

constexpr double kNever = std::numeric_limits<double>::infinity();

// The symmetric matrix of Equation 4 by its upper triangle, row by row.
struct Quadric {
  std::array<double, 10> q{};

  void add_plane(double a, double b, double c, double d) {
    const std::array<double, 10> plane = {a * a, a * b, a * c, a * d, b * b,
                                          b * c, b * d, c * c, c * d, d * d};
    for (std::size_t k = 0; k < q.size(); ++k) q[k] += plane[k];
  }
  Quadric& operator+=(const Quadric& other) {
    for (std::size_t k = 0; k < q.size(); ++k) q[k] += other.q[k];
    return *this;
  }
  // Never below zero, which rounding could make it.
  double error_at(const Position& p) const {
    const auto& [x, y, z] = p;
    const double xs = q[0] * x + 2 * (q[1] * y + q[2] * z + q[3]);
    const double ys = q[4] * y + 2 * (q[5] * z + q[6]);
    const double zs = q[7] * z + 2 * q[8];
    return std::max(0.0, xs * x + ys * y + zs * z + q[9]);
  }
};

struct Vertex {
  Quadric quadric;
  Position place{};  // relative to the block's middle, so that little is lost in squares
  double own_error_m2 = 0;
  // Where it would go.
  double least_error_m2 = kNever;
  Index target = CollapseMesh::kNone;
  // A better target was refused, because the surface would fold or lose its topology.
  bool is_restricted = false;
  bool is_on_rim = false;
};

class DetailSimplifier {
 public:
  DetailSimplifier(std::span<const DetailPoint> points, std::span<const std::uint32_t> triangles,
                   const DetailFrame& frame)
      : points_(points),
        mesh_(triangles, points.size()),
        vertices_(points.size()),
        queue_(static_cast<Index>(points.size())) {
    place_vertices(frame);
    add_planes();
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      vertices_[at(v)].is_on_rim = mesh_.vertex_on_hull(v);
    }
    for (Index v = 0; v < mesh_.vertex_count(); ++v) {
      if (!vertices_[at(v)].is_on_rim) find_target(v);
    }
  }

  DetailRecord run(std::int64_t target_triangles, const std::function<void(std::int64_t)>& tick) {
    constexpr std::size_t kCollapsesATick = 4096;
    DetailRecord record;
    while (mesh_.triangle_count() > target_triangles && !queue_.empty()) {
      const Index u = queue_.top().edge;
      const Index e = half_edge_to(u, vertices_[at(u)].target);
      if (is_sound(e)) {
        collapse(e, record);
        if (tick && record.collapses.size() % kCollapsesATick == 0) tick(kCollapsesATick);
      } else {
        find_sound_target(u);
      }
    }
    record.mean_least_error_m2 = mean_least_error();
    return record;
  }

 private:
  void place_vertices(const DetailFrame& frame) {
    Position low = frame.place(points_.front());
    Position high = low;
    for (const DetailPoint& point : points_) {
      const Position place = frame.place(point);
      for (std::size_t k = 0; k < 3; ++k) {
        low[k] = std::min(low[k], place[k]);
        high[k] = std::max(high[k], place[k]);
      }
    }
    for (std::size_t v = 0; v < points_.size(); ++v) {
      const Position place = frame.place(points_[v]);
      for (std::size_t k = 0; k < 3; ++k) {
        vertices_[v].place[k] = place[k] - (low[k] + high[k]) / 2;
      }
    }
  }

  void add_planes() {
    for (Index e = 0; e < mesh_.half_edge_count(); e += 3) {
      const std::array<Index, 3> corners = {mesh_.origin(e), mesh_.origin(e + 1),
                                            mesh_.origin(e + 2)};
      const Position& p = vertices_[at(corners[0])].place;
      const Position& q = vertices_[at(corners[1])].place;
      const Position& r = vertices_[at(corners[2])].place;
      const Position u = {q[0] - p[0], q[1] - p[1], q[2] - p[2]};
      const Position v = {r[0] - p[0], r[1] - p[1], r[2] - p[2]};
      Position n = {u[1] * v[2] - u[2] * v[1], u[2] * v[0] - u[0] * v[2],
                    u[0] * v[1] - u[1] * v[0]};
      // Not zero: its z is twice the area seen from above.
      const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
      for (double& part : n) part /= length;
      const double d = -(n[0] * p[0] + n[1] * p[1] + n[2] * p[2]);
      for (const Index corner : corners) {
        vertices_[at(corner)].quadric.add_plane(n[0], n[1], n[2], d);
      }
    }
  }

  double error_of(Index u, Index target) const {
    const Vertex& end = vertices_[at(target)];
    return vertices_[at(u)].quadric.error_at(end.place) + end.own_error_m2;
  }

  Index half_edge_to(Index u, Index target) const {
    Index found = CollapseMesh::kNone;
    mesh_.each_leaving(u, [&](Index e) {
      if (mesh_.target(e) == target) found = e;
    });
    return found;
  }

  // Whether the origin of e may go to its target.
  bool is_sound(Index e) {
    if (!mesh_.may_collapse(e)) return false;
    const DetailPoint& end = points_[at(mesh_.target(e))];
    bool is_flat = true;
    mesh_.each_leaving(mesh_.origin(e), [&](Index k) {
      const Index right = mesh_.target(k);
      const Index left = mesh_.origin(CollapseMesh::previous(k));
      if (right == mesh_.target(e) || left == mesh_.target(e)) return;
      is_flat = is_flat && plane_orientation(end, points_[at(right)], points_[at(left)]) > 0;
    });
    return is_flat;
  }

  void set_target(Index u, double error_m2, Index target) {
    Vertex& vertex = vertices_[at(u)];
    if (vertex.target != CollapseMesh::kNone) sum_m2_ -= vertex.least_error_m2;
    vertex.least_error_m2 = error_m2;
    vertex.target = target;
    if (target == CollapseMesh::kNone) {
      queue_.remove(u);
    } else {
      sum_m2_ += error_m2;
      queue_.set(u, error_m2);
    }
  }

  // The best of those that `allowed(half_edge)` lets pass.
  template <class Allowed>
  void find_target_among(Index u, const Allowed& allowed) {
    double least_m2 = kNever;
    Index target = CollapseMesh::kNone;
    mesh_.each_leaving(u, [&](Index e) {
      const Index w = mesh_.target(e);
      const double error_m2 = error_of(u, w);
      const bool is_less = error_m2 < least_m2 || (error_m2 == least_m2 && w < target);
      if (!is_less || !allowed(e)) return;
      least_m2 = error_m2;
      target = w;
    });
    set_target(u, least_m2, target);
  }

  void find_target(Index u) {
    vertices_[at(u)].is_restricted = false;
    find_target_among(u, [](Index /*e*/) { return true; });
  }

  void find_sound_target(Index u) {
    vertices_[at(u)].is_restricted = true;
    find_target_among(u, [this](Index e) { return is_sound(e); });
  }

  void collapse(Index e, DetailRecord& record) {
    const Index u = mesh_.origin(e);
    const Index v = mesh_.target(e);
    const Index twin = mesh_.twin(e);
    // Counter-clockwise from e come its own triangle, the fan, and the twin's triangle.
    DetailCollapse& collapse = record.collapses.emplace_back();
    collapse = {.removed = u,
                .kept = v,
                .half_edge = e,
                .twin = twin,
                .first_of_fan = mesh_.twin(CollapseMesh::previous(e)),
                .fan = -2,
                .mean_least_error_m2 = mean_least_error()};
    mesh_.each_leaving(u, [&](Index /*k*/) { ++collapse.fan; });
    set_target(u, kNever, CollapseMesh::kNone);
    mesh_.collapse(e, v);
    Vertex& kept = vertices_[at(v)];
    kept.quadric += vertices_[at(u)].quadric;
    kept.own_error_m2 = kept.quadric.error_at(kept.place);
    if (!kept.is_on_rim) find_target(v);
    mesh_.each_neighbour(v, [&](Index w) {
      if (!vertices_[at(w)].is_on_rim) look_again(w, u, v);
    });
  }

  // At a neighbour of v, to which u went.
  void look_again(Index w, Index u, Index v) {
    const Vertex& vertex = vertices_[at(w)];
    if (vertex.is_restricted || vertex.target == u || vertex.target == v) return find_target(w);
    const double error_m2 = error_of(w, v);
    const bool is_less = error_m2 < vertex.least_error_m2 ||
                         (error_m2 == vertex.least_error_m2 && v < vertex.target);
    if (is_less) set_target(w, error_m2, v);
  }

  double mean_least_error() const {
    return queue_.empty() ? 0 : std::max(0.0, sum_m2_ / static_cast<double>(queue_.size()));
  }

  std::span<const DetailPoint> points_;
  CollapseMesh mesh_;
  std::vector<Vertex> vertices_;
  CollapseQueue queue_;
  // Of the least errors of all vertices in the queue.
  double sum_m2_ = 0;
};

}  // namespace

DetailRecord simplify_by_quadrics(std::span<const DetailPoint> points,
                                  std::span<const std::uint32_t> triangles,
                                  const DetailFrame& frame, std::int64_t target_triangles,
                                  const std::function<void(std::int64_t)>& tick) {
  for (const DetailPoint& point : points) {
    QMPIPE_CHECK(0 <= point.x && point.x <= kDetailGridMax);
    QMPIPE_CHECK(0 <= point.y && point.y <= kDetailGridMax);
  }
  return DetailSimplifier(points, triangles, frame).run(target_triangles, tick);
}

}  // namespace qmpipe
