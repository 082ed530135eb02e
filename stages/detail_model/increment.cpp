#include "stages/detail_model/increment.h"

#include <algorithm>
#include <utility>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

TriangleVertices triangle_of(const DetailWalk& walk, std::size_t number) {
  const auto vertices = walk.triangles().subspan(3 * number, 3);
  return {vertices[0], vertices[1], vertices[2]};
}

}  // namespace

Result<DetailIncrement> increment_to(DetailWalk& walk, std::size_t fine_level) {
  QMPIPE_CHECK(walk.level() < fine_level);
  DetailIncrement increment;
  increment.coarse_level = walk.level();
  increment.fine_level = fine_level;
  const std::size_t coarse_triangles = walk.triangles().size() / 3;
  std::vector<std::pair<std::uint32_t, TriangleVertices>> touched;
  while (walk.level() < fine_level) {
    auto error = walk.refine([&](std::uint32_t triangle) {
      if (triangle < coarse_triangles) touched.emplace_back(triangle, triangle_of(walk, triangle));
    });
    if (error) return std::move(*error);
  }
  // Of a triangle that changed several times the first is its state at the coarser level.
  std::stable_sort(touched.begin(), touched.end(),
                   [](const auto& a, const auto& b) { return a.first < b.first; });
  for (const auto& [number, coarse] : touched) {
    if (!increment.replaced.empty() && increment.replaced.back() == number) continue;
    increment.replaced.push_back(number);
    increment.replaced_coarse.push_back(coarse);
    increment.replaced_fine.push_back(triangle_of(walk, number));
  }
  for (std::size_t t = coarse_triangles; t < walk.triangles().size() / 3; ++t) {
    increment.deleted.push_back(triangle_of(walk, t));
  }
  return increment;
}

void refine_by(const DetailIncrement& increment, std::vector<TriangleVertices>& triangles) {
  for (std::size_t k = 0; k < increment.replaced.size(); ++k) {
    triangles[increment.replaced[k]] = increment.replaced_fine[k];
  }
  triangles.insert(triangles.end(), increment.deleted.begin(), increment.deleted.end());
}

void coarsen_by(const DetailIncrement& increment, std::vector<TriangleVertices>& triangles) {
  QMPIPE_CHECK(triangles.size() >= increment.deleted.size());
  triangles.resize(triangles.size() - increment.deleted.size());
  for (std::size_t k = 0; k < increment.replaced.size(); ++k) {
    triangles[increment.replaced[k]] = increment.replaced_coarse[k];
  }
}

}  // namespace qmpipe
