// The edges of a list of triangles, three points each: half-edge 3 t + k runs from the k-th point of
// triangle t to the next one.
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

namespace qmpipe {

struct TriangleEdge {
  std::uint64_t ends = 0;  // the lower point in the upper half
  std::uint32_t half_edge = 0;
};

// One for each half-edge; those of one edge stand side by side, the lower half-edge first.
std::vector<TriangleEdge> sorted_edges(std::span<const std::uint32_t> triangles);

// From and to, sorted: the half-edges without one that runs the other way.
std::vector<std::pair<std::uint32_t, std::uint32_t>> rim_of(
    std::span<const std::uint32_t> triangles);

}  // namespace qmpipe
