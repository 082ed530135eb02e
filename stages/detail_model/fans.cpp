#include <algorithm>
#include <cmath>
#include <numeric>

#include "scheduler/check.h"
#include "stages/detail_model/base.h"
#include "stages/surface/triangle_edges.h"

namespace qmpipe {
namespace {

// Corners of triangles that belong together because their triangles share an edge at the vertex.
class CornerSets {
 public:
  explicit CornerSets(std::size_t corners) : parent_(corners) {
    std::iota(parent_.begin(), parent_.end(), 0U);
  }
  std::uint32_t find(std::uint32_t corner) {
    while (parent_[corner] != corner) corner = parent_[corner] = parent_[parent_[corner]];
    return corner;
  }
  // The lower one stands for both.
  void join(std::uint32_t a, std::uint32_t b) {
    a = find(a);
    b = find(b);
    parent_[std::max(a, b)] = std::min(a, b);
  }

 private:
  std::vector<std::uint32_t> parent_;
};

}  // namespace

void separate_fans(std::vector<DetailPoint>& points, std::vector<std::uint32_t>& triangles,
                   std::vector<std::uint32_t>& origin) {
  CornerSets fans(triangles.size());
  const std::vector<TriangleEdge> edges = sorted_edges(triangles);
  const auto next = [](std::uint32_t e) { return e % 3 == 2 ? e - 2 : e + 1; };
  for (std::size_t k = 1; k < edges.size(); ++k) {
    if (edges[k].ends != edges[k - 1].ends) continue;
    const std::uint32_t e = edges[k - 1].half_edge;
    const std::uint32_t f = edges[k].half_edge;
    QMPIPE_CHECK(triangles[e] == triangles[next(f)]);
    fans.join(e, next(f));
    fans.join(next(e), f);
  }
  std::vector<DetailPoint> used;
  std::vector<std::uint32_t> number(triangles.size());
  origin.clear();
  for (std::uint32_t e = 0; e < triangles.size(); ++e) {
    const std::uint32_t fan = fans.find(e);
    if (fan == e) {
      number[e] = static_cast<std::uint32_t>(used.size());
      used.push_back(points[triangles[e]]);
      origin.push_back(triangles[e]);
    }
    triangles[e] = number[fan];
  }
  points = std::move(used);
}

BlockGrid block_grid_of(std::int32_t blocks) {
  QMPIPE_CHECK(blocks > 0);
  std::int32_t rows = 1;
  for (std::int32_t k = 1; std::int64_t{k} * k <= blocks; ++k) {
    if (blocks % k == 0) rows = k;
  }
  return {.columns = blocks / rows, .rows = rows};
}

}  // namespace qmpipe
