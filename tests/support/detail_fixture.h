// Small meshes for the tests of the detail-increment model.
#pragma once

#include <cmath>
#include <cstdint>
#include <random>
#include <set>
#include <vector>

#include "formats/detail_model/data.h"

namespace qmpipe::testing {

struct DetailMesh {
  std::vector<DetailPoint> points;
  std::vector<std::uint32_t> triangles;
};

// Hills on a grid of width x height points ten apart, moved about by up to two; cells that `holes`
// says (row by row) are left out.
inline DetailMesh hilly_mesh(std::int32_t width, std::int32_t height, std::uint32_t seed,
                             const std::set<std::int32_t>& holes = {}) {
  std::mt19937 dice(seed);
  std::uniform_int_distribution<std::int32_t> jitter(-2, 2);
  std::uniform_real_distribution<double> wave(0.05, 0.4);
  const double a = wave(dice);
  const double b = wave(dice);
  DetailMesh mesh;
  for (std::int32_t j = 0; j < height; ++j) {
    for (std::int32_t i = 0; i < width; ++i) {
      const double hill = 60 * std::sin(a * i) * std::cos(b * j);
      mesh.points.push_back({.x = 10 * i + 5 + jitter(dice),
                             .y = 10 * j + 5 + jitter(dice),
                             .z = static_cast<std::int32_t>(std::lround(hill)) + jitter(dice)});
    }
  }
  for (std::int32_t j = 0; j + 1 < height; ++j) {
    for (std::int32_t i = 0; i + 1 < width; ++i) {
      if (holes.contains(j * (width - 1) + i)) continue;
      const auto corner = static_cast<std::uint32_t>(j * width + i);
      const auto up = corner + static_cast<std::uint32_t>(width);
      mesh.triangles.insert(mesh.triangles.end(), {corner, corner + 1, up, up, corner + 1, up + 1});
    }
  }
  return mesh;
}

}  // namespace qmpipe::testing
