// CGAL's part of the detail-increment model: Delaunay triangulations of scattered points.
#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Delaunay_triangulation_2.h>
#include <CGAL/Simple_cartesian.h>
#include <CGAL/Triangulation_face_base_with_info_2.h>
#include <CGAL/Triangulation_vertex_base_with_info_2.h>

#include <algorithm>
#include <array>
#include <utility>

#include "scheduler/check.h"
#include "stages/detail_model/base.h"
#include "stages/surface/morton.h"
#include "stages/surface/triangle_edges.h"

namespace qmpipe {
namespace {

using PlainKernel = CGAL::Simple_cartesian<double>;
using PlanePoint = PlainKernel::Point_2;

// Integers of 30 bits are doubles without loss.
PlanePoint place_of(const DetailPoint& point) {
  return {static_cast<double>(point.x), static_cast<double>(point.y)};
}
DetailPoint point_of(const PlanePoint& place) {
  return {.x = static_cast<std::int32_t>(place.x()), .y = static_cast<std::int32_t>(place.y())};
}

struct DetailOrientation {
  CGAL::Orientation operator()(const PlanePoint& a, const PlanePoint& b,
                               const PlanePoint& c) const {
    return CGAL::sign(plane_orientation(point_of(a), point_of(b), point_of(c)));
  }
};

// The determinant with d as the origin: areas below 2^62 times squared distances below 2^61.
struct DetailSideOfCircle {
  CGAL::Oriented_side operator()(const PlanePoint& a, const PlanePoint& b, const PlanePoint& c,
                                 const PlanePoint& d) const {
    __extension__ using Wide = __int128;
    struct Vector {
      std::int64_t x;
      std::int64_t y;
    };
    const DetailPoint centre = point_of(d);
    const auto from_centre = [&](const PlanePoint& place) {
      const DetailPoint point = point_of(place);
      return Vector{.x = std::int64_t{point.x} - centre.x, .y = std::int64_t{point.y} - centre.y};
    };
    const auto squared = [](const Vector& v) { return Wide{v.x * v.x + v.y * v.y}; };
    const auto area = [](const Vector& v, const Vector& w) { return v.x * w.y - v.y * w.x; };
    const Vector p = from_centre(a);
    const Vector q = from_centre(b);
    const Vector r = from_centre(c);
    const Wide sum = area(p, q) * squared(r) + area(q, r) * squared(p) + area(r, p) * squared(q);
    return CGAL::sign(static_cast<int>(sum > 0) - static_cast<int>(sum < 0));
  }
};

// Exact predicates in a few integer operations: no filters, no multiprecision, no rounding modes.
struct DetailKernel : PlainKernel {
  using Orientation_2 = DetailOrientation;
  using Side_of_oriented_circle_2 = DetailSideOfCircle;
  Orientation_2 orientation_2_object() const { return {}; }
  Side_of_oriented_circle_2 side_of_oriented_circle_2_object() const { return {}; }
};

std::int32_t part_of(std::int32_t value, std::int32_t low, std::int32_t high, std::int32_t parts) {
  const std::int64_t width = std::max(1, high - low);
  return static_cast<std::int32_t>(
      std::min<std::int64_t>(std::int64_t{value - low} * parts / width, parts - 1));
}

// The lowest vertex first, then by the vertices: faces come in no order that means anything.
void put_in_order(std::vector<std::array<std::uint32_t, 3>>& triangles) {
  for (auto& t : triangles) std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  std::sort(triangles.begin(), triangles.end());
}

enum class Region : std::uint8_t { kUnknown, kBlock };

class HullJoiner {
  using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<DetailCorner, DetailKernel>;
  using FaceInfo = CGAL::Triangulation_face_base_with_info_2<Region, DetailKernel>;
  using FaceBase = CGAL::Constrained_triangulation_face_base_2<DetailKernel, FaceInfo>;
  using Data = CGAL::Triangulation_data_structure_2<VertexBase, FaceBase>;
  using Triangulation =
      CGAL::Constrained_Delaunay_triangulation_2<DetailKernel, Data,
                                                 CGAL::No_constraint_intersection_tag>;

 public:
  std::vector<DetailSeam> run(std::span<const BaseBlock> blocks) {
    for (std::uint32_t b = 0; b < blocks.size(); ++b) add(b, blocks[b]);
    if (triangulation_.dimension() < 2) return {};
    for (auto face : triangulation_.all_face_handles()) face->info() = Region::kUnknown;
    for (const auto& [from, to] : rims_) mark_left_of(from, to);
    std::vector<std::array<DetailCorner, 3>> seams;
    for (auto face : triangulation_.finite_face_handles()) {
      if (face->info() == Region::kBlock) continue;
      seams.push_back({face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()});
    }
    const auto key = [](const DetailCorner& c) { return std::pair(c.block, c.point); };
    const auto less = [&](const DetailCorner& a, const DetailCorner& b) { return key(a) < key(b); };
    for (auto& t : seams) {
      std::rotate(t.begin(), std::min_element(t.begin(), t.end(), less), t.end());
    }
    std::sort(seams.begin(), seams.end(), [&](const DetailSeam& a, const DetailSeam& b) {
      return std::lexicographical_compare(a.begin(), a.end(), b.begin(), b.end(), less);
    });
    return seams;
  }

 private:
  using Vertex = Triangulation::Vertex_handle;
  using Face = Triangulation::Face_handle;

  void add(std::uint32_t b, const BaseBlock& block) {
    std::vector<Vertex> vertices(block.points.size());
    const auto insert = [&](std::uint32_t k) {
      if (vertices[k] != Vertex()) return;
      vertices[k] = triangulation_.insert(place_of(block.points[k]));
      vertices[k]->info() = {.block = b, .point = k};
    };
    for (const auto& [from, to] : rim_of(block.triangles)) {
      insert(from);
      insert(to);
      triangulation_.insert_constraint(vertices[from], vertices[to]);
      rims_.emplace_back(vertices[from], vertices[to]);
    }
    for (auto k = static_cast<std::uint32_t>(block.mesh_points); k < block.points.size(); ++k) {
      insert(k);
    }
  }

  void mark_left_of(Vertex from, Vertex to) {
    Face face;
    int index = 0;
    QMPIPE_CHECK(triangulation_.is_edge(from, to, face, index));
    // is_edge() gives either of the edge's faces.
    if (face->vertex(Triangulation::ccw(index)) != from) face = face->neighbor(index);
    std::vector<Face> to_mark = {face};
    while (!to_mark.empty()) {
      const Face marked = to_mark.back();
      to_mark.pop_back();
      if (marked->info() == Region::kBlock) continue;
      marked->info() = Region::kBlock;
      for (int k = 0; k < 3; ++k) {
        if (!marked->is_constrained(k)) to_mark.push_back(marked->neighbor(k));
      }
    }
  }

  Triangulation triangulation_;
  std::vector<std::pair<Vertex, Vertex>> rims_;
};

}  // namespace

std::vector<std::vector<DetailPoint>> split_into_blocks(std::span<const DetailPoint> points,
                                                        const BlockGrid& grid) {
  std::vector<std::vector<DetailPoint>> blocks(static_cast<std::size_t>(grid.columns) *
                                               static_cast<std::size_t>(grid.rows));
  if (points.empty()) return blocks;
  const auto by_x = [](const DetailPoint& a, const DetailPoint& b) { return a.x < b.x; };
  const auto by_y = [](const DetailPoint& a, const DetailPoint& b) { return a.y < b.y; };
  const auto [west, east] = std::minmax_element(points.begin(), points.end(), by_x);
  const auto [south, north] = std::minmax_element(points.begin(), points.end(), by_y);
  for (const DetailPoint& point : points) {
    const std::int32_t column = part_of(point.x, west->x, east->x, grid.columns);
    const std::int32_t row = part_of(point.y, south->y, north->y, grid.rows);
    blocks[static_cast<std::size_t>(row) * static_cast<std::size_t>(grid.columns) +
           static_cast<std::size_t>(column)]
        .push_back(point);
  }
  for (auto& block : blocks) {
    std::sort(block.begin(), block.end(), [](const DetailPoint& a, const DetailPoint& b) {
      return morton_code(static_cast<std::uint32_t>(a.x), static_cast<std::uint32_t>(a.y)) <
             morton_code(static_cast<std::uint32_t>(b.x), static_cast<std::uint32_t>(b.y));
    });
  }
  return blocks;
}

BaseBlock triangulate_block(std::vector<DetailPoint> points) {
  using VertexBase = CGAL::Triangulation_vertex_base_with_info_2<std::uint32_t, DetailKernel>;
  using Data = CGAL::Triangulation_data_structure_2<VertexBase>;
  CGAL::Delaunay_triangulation_2<DetailKernel, Data> triangulation;
  decltype(triangulation)::Face_handle near;
  for (std::uint32_t k = 0; k < points.size(); ++k) {
    const auto vertex = triangulation.insert(place_of(points[k]), near);
    vertex->info() = k;
    near = vertex->face();
  }
  QMPIPE_CHECK(triangulation.number_of_vertices() == points.size());
  BaseBlock block;
  block.points = std::move(points);
  if (triangulation.dimension() < 2) return block;
  block.mesh_points = block.points.size();
  std::vector<std::array<std::uint32_t, 3>> triangles;
  for (auto face : triangulation.finite_face_handles()) {
    triangles.push_back(
        {face->vertex(0)->info(), face->vertex(1)->info(), face->vertex(2)->info()});
  }
  put_in_order(triangles);
  for (const auto& t : triangles) block.triangles.insert(block.triangles.end(), t.begin(), t.end());
  return block;
}

std::vector<DetailSeam> join_hulls(std::span<const BaseBlock> blocks) {
  return HullJoiner().run(blocks);
}

}  // namespace qmpipe
