#include "stages/point_sets/sharp_edges.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "scheduler/elementary.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {

// By vertex: the values of vertex k are at begin[k] .. begin[k + 1].
template <class Value>
struct ByVertex {
  std::vector<std::uint32_t> begin;
  std::vector<Value> values;

  std::span<const Value> of(std::uint32_t vertex) const {
    return std::span(values).subspan(begin[vertex], begin[vertex + 1] - begin[vertex]);
  }
};

// Pairs of a vertex and a value, put together by vertex, in the order in which they come.
template <class Value>
ByVertex<Value> by_vertex(std::size_t vertex_count,
                          std::span<const std::pair<std::uint32_t, Value>> pairs) {
  ByVertex<Value> result;
  result.begin.assign(vertex_count + 1, 0);
  for (const auto& [vertex, value] : pairs) ++result.begin[vertex + 1];
  for (std::size_t k = 0; k < vertex_count; ++k) result.begin[k + 1] += result.begin[k];
  result.values.resize(pairs.size());
  std::vector<std::uint32_t> next(result.begin.begin(), result.begin.end() - 1);
  for (const auto& [vertex, value] : pairs) result.values[next[vertex]++] = value;
  return result;
}

using Edge = std::pair<std::uint32_t, std::uint32_t>;

std::vector<Vec3> scaled_normals(const Tin& tin) {
  double u_max = 1;
  double v_max = 1;
  double lowest_m = tin.vertices.front().height_m;
  double highest_m = lowest_m;
  for (const TinVertex& vertex : tin.vertices) {
    u_max = std::max(u_max, static_cast<double>(vertex.u));
    v_max = std::max(v_max, static_cast<double>(vertex.v));
    lowest_m = std::min(lowest_m, vertex.height_m);
    highest_m = std::max(highest_m, vertex.height_m);
  }
  // All heights equal: nothing is sharp, whatever the scale.
  const double range_m = highest_m > lowest_m ? highest_m - lowest_m : 1;
  const auto place = [&](std::uint32_t k) {
    const TinVertex& vertex = tin.vertices[k];
    return Vec3{vertex.u / u_max, vertex.v / v_max, (vertex.height_m - lowest_m) / range_m};
  };
  std::vector<Vec3> normals;
  normals.reserve(tin.triangle_count());
  for (std::size_t t = 0; t < tin.indices.size(); t += 3) {
    const Vec3 a = place(tin.indices[t]);
    normals.push_back(
        unit(cross(minus(place(tin.indices[t + 1]), a), minus(place(tin.indices[t + 2]), a))));
  }
  return normals;
}

// Sharp edges, each once, from its lower vertex to its higher one, in the order of triangles.
std::vector<Edge> sharp_edges(const Tin& tin, double angle_deg) {
  struct HalfEdge {
    std::uint32_t to = 0;
    std::uint32_t triangle = 0;
  };
  std::vector<std::pair<std::uint32_t, HalfEdge>> upwards;
  upwards.reserve(tin.indices.size() / 2);
  const auto next_in_triangle = [](std::size_t k) { return k % 3 == 2 ? k - 2 : k + 1; };
  for (std::size_t k = 0; k < tin.indices.size(); ++k) {
    const std::uint32_t from = tin.indices[k];
    const std::uint32_t to = tin.indices[next_in_triangle(k)];
    if (from < to) upwards.push_back({from, {to, static_cast<std::uint32_t>(k / 3)}});
  }
  const auto starts = by_vertex<HalfEdge>(tin.vertices.size(), upwards);
  const std::vector<Vec3> normals = scaled_normals(tin);
  const double least_cosine = cos_deg(angle_deg);
  std::vector<Edge> sharp;
  for (std::size_t k = 0; k < tin.indices.size(); ++k) {
    const std::uint32_t high = tin.indices[k];
    const std::uint32_t low = tin.indices[next_in_triangle(k)];
    if (high < low) continue;
    for (const HalfEdge& twin : starts.of(low)) {
      if (twin.to == high && dot(normals[k / 3], normals[twin.triangle]) < least_cosine) {
        sharp.emplace_back(low, high);
      }
    }
  }
  return sharp;
}

class Tracer {
 public:
  Tracer(std::size_t vertex_count, std::span<const Edge> edges) : used_(edges.size(), 0) {
    std::vector<std::pair<std::uint32_t, End>> ends;
    for (std::size_t k = 0; k < edges.size(); ++k) {
      const auto edge = static_cast<std::uint32_t>(k);
      ends.push_back({edges[k].first, {edges[k].second, edge}});
      ends.push_back({edges[k].second, {edges[k].first, edge}});
    }
    ends_ = by_vertex<End>(vertex_count, ends);
  }

  std::vector<VertexPolyline> run() {
    std::vector<VertexPolyline> polylines;
    const auto vertex_count = static_cast<std::uint32_t>(ends_.begin.size() - 1);
    for (const bool closed : {false, true}) {
      for (std::uint32_t vertex = 0; vertex < vertex_count; ++vertex) {
        if ((ends_.of(vertex).size() == 2) != closed) continue;
        for (const End& end : ends_.of(vertex)) {
          if (used_[end.edge] == 0) polylines.push_back(trace(vertex, end));
        }
      }
    }
    return polylines;
  }

 private:
  struct End {
    std::uint32_t other = 0;
    std::uint32_t edge = 0;
  };

  VertexPolyline trace(std::uint32_t start, End end) {
    VertexPolyline polyline = {start};
    for (;;) {
      used_[end.edge] = 1;
      polyline.push_back(end.other);
      const auto ends = ends_.of(end.other);
      if (ends.size() != 2 || end.other == start) return polyline;
      end = ends[ends[0].edge == end.edge ? 1 : 0];
    }
  }

  ByVertex<End> ends_;
  std::vector<std::uint8_t> used_;
};

}  // namespace

std::vector<VertexPolyline> sharp_polylines(const Tin& tin, const SharpEdgeOptions& options) {
  const auto edges = sharp_edges(tin, options.angle_deg);
  auto polylines = Tracer(tin.vertices.size(), edges).run();
  const auto is_short = [&](const VertexPolyline& polyline) {
    const bool closed = polyline.front() == polyline.back();
    return static_cast<std::int64_t>(polyline.size()) - (closed ? 1 : 0) < options.least_points;
  };
  polylines.erase(std::remove_if(polylines.begin(), polylines.end(), is_short), polylines.end());
  return polylines;
}

}  // namespace qmpipe
