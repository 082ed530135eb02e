#include "stages/surface/triangle_edges.h"

#include <algorithm>

namespace qmpipe {
namespace {

std::size_t next(std::size_t e) { return e % 3 == 2 ? e - 2 : e + 1; }

}  // namespace

std::vector<TriangleEdge> sorted_edges(std::span<const std::uint32_t> triangles) {
  std::vector<TriangleEdge> edges;
  edges.reserve(triangles.size());
  for (std::size_t e = 0; e < triangles.size(); ++e) {
    const std::uint64_t from = triangles[e];
    const std::uint64_t to = triangles[next(e)];
    edges.push_back({.ends = std::min(from, to) << 32U | std::max(from, to),
                     .half_edge = static_cast<std::uint32_t>(e)});
  }
  std::sort(edges.begin(), edges.end(), [](const TriangleEdge& a, const TriangleEdge& b) {
    return a.ends != b.ends ? a.ends < b.ends : a.half_edge < b.half_edge;
  });
  return edges;
}

std::vector<std::pair<std::uint32_t, std::uint32_t>> rim_of(
    std::span<const std::uint32_t> triangles) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  edges.reserve(triangles.size());
  for (std::size_t e = 0; e < triangles.size(); ++e) {
    edges.emplace_back(triangles[e], triangles[next(e)]);
  }
  std::sort(edges.begin(), edges.end());
  std::vector<std::pair<std::uint32_t, std::uint32_t>> rim;
  for (const auto& [from, to] : edges) {
    if (!std::binary_search(edges.begin(), edges.end(), std::pair(to, from))) {
      rim.emplace_back(from, to);
    }
  }
  return rim;
}

}  // namespace qmpipe
