// The constrained Delaunay triangulation of points in the quantized frame.
//
// Guarantees: exact in integer arithmetic. Of four points on one circle the lexicographically
// largest counts as slightly outside, as if lifted, so the triangulation is unique: it depends on
// the points and the edges, and not on their order (but for the numbers of the vertices).
#pragma once

#include <cstdint>
#include <span>
#include <utility>
#include <vector>

#include "stages/surface/delaunay.h"

namespace qmpipe {

// Three points for each triangle, counter-clockwise from its lowest index, in ascending order; they
// cover the convex hull. An edge with points in its inside is there in parts.
// REQUIRES: different points, not all on a line, 0 <= x, y <= 32767; edges that meet only in points.
std::vector<std::uint32_t> constrained_delaunay(
    std::span<const IntPoint> points,
    std::span<const std::pair<std::uint32_t, std::uint32_t>> edges);

}  // namespace qmpipe
