#include "stages/surface/constrained_delaunay.h"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Constrained_triangulation_face_base_2.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <array>

#include "scheduler/check.h"
#include "stages/surface/morton.h"

namespace qmpipe {
namespace {

// Coordinates are integers in doubles, so that exact predicates are a few integer operations: no
// filters, no multiprecision, no rounding modes to set.
using PlainKernel = CGAL::Simple_cartesian<double>;
using PlainPoint = PlainKernel::Point_2;

IntPoint int_point(const PlainPoint& p) {
  return {static_cast<std::int32_t>(p.x()), static_cast<std::int32_t>(p.y())};
}

struct ExactOrientation {
  CGAL::Orientation operator()(const PlainPoint& a, const PlainPoint& b,
                               const PlainPoint& c) const {
    return CGAL::sign(orientation(int_point(a), int_point(b), int_point(c)));
  }
};

// The determinant of stages/surface/delaunay.h, for any order of a, b, c.
struct ExactSideOfCircle {
  CGAL::Oriented_side operator()(const PlainPoint& a, const PlainPoint& b, const PlainPoint& c,
                                 const PlainPoint& d) const {
    const IntPoint centre = int_point(d);
    const auto from_d = [&](const PlainPoint& p) {
      const IntPoint q = int_point(p);
      return IntPoint{q.x - centre.x, q.y - centre.y};
    };
    const auto squared = [](const IntPoint& p) {
      return static_cast<std::int64_t>(p.x) * p.x + static_cast<std::int64_t>(p.y) * p.y;
    };
    const auto area = [](const IntPoint& p, const IntPoint& q) {
      return static_cast<std::int64_t>(p.x) * q.y - static_cast<std::int64_t>(p.y) * q.x;
    };
    const IntPoint p = from_d(a);
    const IntPoint q = from_d(b);
    const IntPoint r = from_d(c);
    return CGAL::sign(area(p, q) * squared(r) + area(q, r) * squared(p) + area(r, p) * squared(q));
  }
};

struct ExactKernel : PlainKernel {
  using Orientation_2 = ExactOrientation;
  using Side_of_oriented_circle_2 = ExactSideOfCircle;
  Orientation_2 orientation_2_object() const { return {}; }
  Side_of_oriented_circle_2 side_of_oriented_circle_2_object() const { return {}; }
};

using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, ExactKernel>;
using FaceBase = CGAL::Constrained_triangulation_face_base_2<ExactKernel>;
using Structure = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
using Cdt = CGAL::Constrained_Delaunay_triangulation_2<ExactKernel, Structure,
                                                       CGAL::No_constraint_intersection_tag>;

// Along a space-filling curve, so that each point is near the one before it.
std::vector<std::uint32_t> insertion_order(std::span<const IntPoint> points) {
  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
  keys.reserve(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    keys.emplace_back(morton_code(static_cast<std::uint32_t>(points[k].x),
                                  static_cast<std::uint32_t>(points[k].y)),
                      static_cast<std::uint32_t>(k));
  }
  std::sort(keys.begin(), keys.end());
  std::vector<std::uint32_t> order;
  order.reserve(keys.size());
  for (const auto& [key, index] : keys) order.push_back(index);
  return order;
}

std::vector<std::uint32_t> sorted_triangles(const Cdt& cdt) {
  std::vector<std::array<std::uint32_t, 3>> triangles;
  triangles.reserve(cdt.number_of_faces());
  for (auto face = cdt.finite_faces_begin(); face != cdt.finite_faces_end(); ++face) {
    std::array<std::uint32_t, 3> t = {face->vertex(0)->info(), face->vertex(1)->info(),
                                      face->vertex(2)->info()};
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    triangles.push_back(t);
  }
  std::sort(triangles.begin(), triangles.end());
  std::vector<std::uint32_t> indices;
  indices.reserve(3 * triangles.size());
  for (const auto& t : triangles) indices.insert(indices.end(), t.begin(), t.end());
  return indices;
}

}  // namespace

std::vector<std::uint32_t> constrained_delaunay(
    std::span<const IntPoint> points,
    std::span<const std::pair<std::uint32_t, std::uint32_t>> edges) {
  Cdt cdt;
  std::vector<Cdt::Vertex_handle> vertices(points.size());
  Cdt::Face_handle near;
  for (const std::uint32_t k : insertion_order(points)) {
    vertices[k] = cdt.insert(PlainPoint(points[k].x, points[k].y), near);
    vertices[k]->info() = k;
    near = vertices[k]->face();
  }
  QMPIPE_CHECK(cdt.number_of_vertices() == points.size() && cdt.dimension() == 2);
  for (const auto& [from, to] : edges) cdt.insert_constraint(vertices[from], vertices[to]);
  return sorted_triangles(cdt);
}

}  // namespace qmpipe
