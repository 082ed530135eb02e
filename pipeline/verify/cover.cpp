#include "pipeline/verify/cover.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdint>

#include "stages/surface/delaunay.h"

namespace qmpipe::verify {
namespace {

constexpr std::int64_t kTwiceSquare = 2 * static_cast<std::int64_t>(kQuantizedMax) * kQuantizedMax;

// A place in the square as 30 bits: u, then v.
std::uint64_t place_of_vertex(const QuantizedMesh& mesh, std::uint32_t vertex) {
  return (static_cast<std::uint64_t>(mesh.u[vertex]) << 15U) | mesh.v[vertex];
}

IntPoint point_at(std::uint64_t place) {
  return {.x = static_cast<std::int32_t>(place >> 15U),
          .y = static_cast<std::int32_t>(place & 0x7FFFU)};
}

std::int64_t twice_area(const QuantizedMesh& mesh, std::size_t triangle) {
  const std::uint32_t* corners = &mesh.indices[3 * triangle];
  return orientation(point_at(place_of_vertex(mesh, corners[0])),
                     point_at(place_of_vertex(mesh, corners[1])),
                     point_at(place_of_vertex(mesh, corners[2])));
}

// One use of an edge by a triangle: bits 62..2 the two places, the smaller one first; bit 1 set when
// the triangle has no area; bit 0 set when it runs from the larger place to the smaller.
using EdgeUse = std::uint64_t;

EdgeUse edge_use(std::uint64_t from, std::uint64_t to, std::uint64_t degenerate_bit) {
  const auto [low, high] = std::minmax(from, to);
  return (((low << 30U) | high) << 2U) | (degenerate_bit << 1U) | (from > to ? 1U : 0U);
}

bool is_on_side(std::uint64_t edge) {
  const IntPoint a = point_at(edge >> 30U);
  const IntPoint b = point_at(edge & 0x3FFFFFFFU);
  return (a.x == b.x && (a.x == 0 || a.x == kQuantizedMax)) ||
         (a.y == b.y && (a.y == 0 || a.y == kQuantizedMax));
}

std::string text_of_edge(std::uint64_t edge) {
  const IntPoint a = point_at(edge >> 30U);
  const IntPoint b = point_at(edge & 0x3FFFFFFFU);
  return fmt::format("from (u, v) = ({}, {}) to ({}, {})", a.x, a.y, b.x, b.y);
}

std::vector<EdgeUse> sorted_edge_uses(const QuantizedMesh& mesh) {
  std::vector<EdgeUse> uses;
  uses.reserve(mesh.indices.size());
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) {
    const std::int64_t area = twice_area(mesh, t);
    std::array<std::uint64_t, 3> places{};
    for (std::size_t k = 0; k < 3; ++k) {
      places[k] = place_of_vertex(mesh, mesh.indices[3 * t + k]);
    }
    if (area < 0) std::swap(places[1], places[2]);
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t from = places[k];
      const std::uint64_t to = places[(k + 1) % 3];
      if (from != to) uses.push_back(edge_use(from, to, area == 0 ? 1 : 0));
    }
  }
  std::sort(uses.begin(), uses.end());
  return uses;
}

// How often an edge is used in each direction, by triangles with an area and by all.
struct EdgeTally {
  std::array<std::int64_t, 2> solid{};
  std::int64_t balance = 0;

  void add(EdgeUse use) {
    const std::size_t direction = use & 1U;
    if ((use & 2U) == 0) ++solid[direction];
    balance += direction == 0 ? 1 : -1;
  }
};

struct EdgeFaults {
  std::int64_t count = 0;
  std::uint64_t first = 0;
  void add(std::uint64_t edge) {
    if (count++ == 0) first = edge;
  }
};

}  // namespace

std::vector<Finding> check_triangles(const QuantizedMesh& mesh) {
  std::int64_t clockwise = 0;
  std::int64_t degenerate = 0;
  std::size_t first_clockwise = 0;
  std::size_t first_degenerate = 0;
  for (std::size_t t = mesh.triangle_count(); t-- > 0;) {
    const std::int64_t area = twice_area(mesh, t);
    if (area < 0) {
      ++clockwise;
      first_clockwise = t;
    } else if (area == 0) {
      ++degenerate;
      first_degenerate = t;
    }
  }
  std::vector<Finding> findings;
  if (clockwise > 0) {
    findings.push_back({.kind = FindingKind::kClockwiseTriangle,
                        .key = {},
                        .text = fmt::format("{} of {} triangles run clockwise seen from above, so "
                                            "clients do not draw them; the first is triangle {}",
                                            clockwise, mesh.triangle_count(), first_clockwise)});
  }
  if (degenerate > 0) {
    findings.push_back({.kind = FindingKind::kDegenerateTriangle,
                        .key = {},
                        .text = fmt::format("{} of {} triangles have no area; the first is "
                                            "triangle {}",
                                            degenerate, mesh.triangle_count(), first_degenerate)});
  }
  return findings;
}

std::vector<Finding> check_cover(const QuantizedMesh& mesh) {
  const std::vector<EdgeUse> uses = sorted_edge_uses(mesh);
  EdgeFaults repeated;
  EdgeFaults open;
  for (std::size_t k = 0; k < uses.size();) {
    const std::uint64_t edge = uses[k] >> 2U;
    EdgeTally tally;
    for (; k < uses.size() && uses[k] >> 2U == edge; ++k) tally.add(uses[k]);
    if (tally.solid[0] > 1 || tally.solid[1] > 1) {
      repeated.add(edge);
    } else if (tally.balance != 0 && !is_on_side(edge)) {
      open.add(edge);
    }
  }
  std::vector<Finding> findings;
  if (repeated.count > 0) {
    findings.push_back({.kind = FindingKind::kRepeatedEdge,
                        .key = {},
                        .text = fmt::format("triangles overlap: {} edges have two triangles on one "
                                            "side, the first runs {}",
                                            repeated.count, text_of_edge(repeated.first))});
  }
  if (open.count > 0) {
    findings.push_back({.kind = FindingKind::kOpenEdge,
                        .key = {},
                        .text = fmt::format("a hole or a T-junction: {} edges inside the tile have "
                                            "a triangle on one side only, the first runs {}",
                                            open.count, text_of_edge(open.first))});
  }
  if (!findings.empty()) return findings;
  std::int64_t area = 0;
  for (std::size_t t = 0; t < mesh.triangle_count(); ++t) area += std::abs(twice_area(mesh, t));
  if (area != kTwiceSquare) {
    findings.push_back({.kind = FindingKind::kArea,
                        .key = {},
                        .text = fmt::format("the triangles' areas add up to {:.6f} times the "
                                            "tile's square",
                                            static_cast<double>(area) / kTwiceSquare)});
  }
  return findings;
}

}  // namespace qmpipe::verify
