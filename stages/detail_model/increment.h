// What changes between two levels of a block, each triangle once (Ai et al. 2019, section 2.2): the
// fields of Table 1 after the three rules of compression.
//
// Towards the coarser level the last triangles are deleted, and of those that stay some are replaced;
// towards the finer one the other way round. What happened to a triangle in between is left out: a
// replaced one keeps its vertices at both ends, a deleted one those at the finer.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/bytes/result.h"
#include "stages/detail_model/block.h"

namespace qmpipe {

using TriangleVertices = std::array<std::uint32_t, 3>;

struct DetailIncrement {
  std::size_t coarse_level = 0;
  std::size_t fine_level = 0;
  // At the finer level; the first has the number of triangles at the coarser one.
  std::vector<TriangleVertices> deleted;
  std::vector<std::uint32_t> replaced;  // numbers, ascending
  std::vector<TriangleVertices> replaced_coarse;
  std::vector<TriangleVertices> replaced_fine;

  std::size_t changed() const { return deleted.size() + replaced.size(); }
};

// Walks to the finer level and tells what changed. REQUIRES: walk.level() < fine_level <= levels.
Result<DetailIncrement> increment_to(DetailWalk& walk, std::size_t fine_level);

// Change the triangles of one of the increment's levels into those of the other. REQUIRES: they are
// those of that level.
void refine_by(const DetailIncrement& increment, std::vector<TriangleVertices>& triangles);
void coarsen_by(const DetailIncrement& increment, std::vector<TriangleVertices>& triangles);

}  // namespace qmpipe
