// The heights that each tile of a plan really has, voids filled: what decides the height steps.
#pragma once

#include <vector>

#include "pipeline/survey/survey.h"
#include "stages/posts/height_step.h"

namespace qmpipe {

// Of the tiles of one zoom.
struct ZoomHeights {
  double largest_range_m = 0;  // of the tile with the largest one
  double reach_m = 0;          // how far from 0 m the farthest post is
};

// By zoom. A tile without voids has the survey's range, of any other the posts are looked at; so what is
// far outside the data coarsens no height inside them. Does not depend on threads.
// REQUIRES: `keys` by zoom, of the survey's zooms; a settled policy. Throws IoError.
std::vector<ZoomHeights> heights_by_zoom(const Survey& survey, const VoidPolicy& policy,
                                         const std::vector<std::vector<TileKey>>& keys,
                                         std::int32_t threads);

}  // namespace qmpipe
