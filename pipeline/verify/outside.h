// What a set shows where its source has no data: one surface for all zooms, without cliffs.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "pipeline/common/finding.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe::verify {

struct TileOutside {
  TileKey key;
  const QuantizedMesh& mesh;
  std::span<const std::uint8_t> valid;  // of its 257 x 257 posts; 0: outside the data
  double tolerance_m = 0;
};

// At most one finding: two neighbouring posts, one of them at least outside the data, that the decoded
// surface puts at a slope of more than 45 degrees, and farther apart than the heights of the data near by
// are; what the tolerance may add is allowed.
std::vector<Finding> find_cliff(const TilingScheme& scheme, const TileOutside& tile,
                                double relief_near_m);

// At most one finding: the post outside the data at which tile and parent are farthest apart, where that
// is more than their tolerances together. REQUIRES: the parent tile of `tile`.
std::vector<Finding> find_levels_apart(const TilingScheme& scheme, const TileOutside& tile,
                                       const TileOutside& parent);

}  // namespace qmpipe::verify
