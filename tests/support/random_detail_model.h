// Random models for the tests of the detail-increment model's file: without fault
// (formats/detail_model/check.h), but without any meaning as terrain.
#pragma once

#include <algorithm>
#include <cstdint>
#include <random>
#include <utility>

#include "formats/detail_model/data.h"

namespace qmpipe::testing {

inline DetailBlock random_detail_block(std::mt19937_64& random, std::size_t coarse_points,
                                       std::size_t coarse_triangles, std::size_t splits) {
  DetailBlock block;
  const std::int32_t reach = random() % 2 == 0 ? 50 : kDetailGridMax;
  std::uniform_int_distribution<std::int32_t> place(0, reach);
  std::uniform_int_distribution<std::int32_t> height(reach == 50 ? -20 : INT32_MIN,
                                                     reach == 50 ? 20 : INT32_MAX);
  for (std::size_t k = 0; k < coarse_points + splits; ++k) {
    block.points.push_back({.x = place(random), .y = place(random), .z = height(random)});
  }
  for (std::size_t k = 0; k < 3 * coarse_triangles; ++k) {
    block.coarse_triangles.push_back(static_cast<std::uint32_t>(random() % coarse_points));
  }
  for (std::size_t level = 0; level < splits; ++level) {
    const std::size_t triangles = coarse_triangles + 2 * level;
    block.splits.push_back(
        {.half_edge = static_cast<std::uint32_t>(random() % (3 * triangles)),
         .fan = static_cast<std::uint32_t>(1 + random() % std::min<std::size_t>(triangles, 12))});
  }
  for (std::size_t level = 0; level <= splits; ++level) {
    block.svo_m.push_back(static_cast<float>(random() % 1000) / 7);
  }
  std::sort(block.svo_m.rbegin(), block.svo_m.rend());
  return block;
}

// Of up to five blocks of up to `most` points, triangles and splits each.
inline DetailModel random_detail_model(std::mt19937_64& random, std::size_t most) {
  DetailModel model;
  std::uniform_real_distribution<double> number(-1e7, 1e7);
  model.frame = {.offset = {number(random), number(random), number(random)},
                 .step_m = {0.01, 1 + std::abs(number(random)), 1}};
  if (random() % 2 == 0) model.crs_wkt = "PROJCRS[\"made up\"]";
  model.interval = static_cast<std::uint32_t>(1 + random() % 1000);
  const std::size_t blocks = 1 + random() % 5;
  for (std::size_t b = 0; b < blocks; ++b) {
    const std::size_t splits = random() % 3 == 0 ? 0 : random() % most;
    model.blocks.push_back(
        random_detail_block(random, 1 + random() % most, 1 + random() % most, splits));
  }
  const std::size_t seams = random() % 2 == 0 ? 0 : random() % most;
  for (std::size_t k = 0; k < seams; ++k) {
    DetailSeam& seam = model.seams.emplace_back();
    for (DetailCorner& corner : seam) {
      corner.block = static_cast<std::uint32_t>(random() % blocks);
      corner.point =
          static_cast<std::uint32_t>(random() % model.blocks[corner.block].coarse_points());
    }
  }
  return model;
}

}  // namespace qmpipe::testing
