// From a survey to everything that is fixed before the first tile is meshed: which tiles, in which
// order, with which tolerance and height step.
#pragma once

#include <vector>

#include "pipeline/build_options.h"
#include "pipeline/recipe.h"
#include "pipeline/survey.h"
#include "scheduler/wavefront.h"

namespace qmpipe {

struct BuildPlan {
  Recipe recipe;
  WavefrontPlan wavefront;
  // By zoom, 0..max_zoom; empty below min_zoom. Sorted.
  std::vector<std::vector<TileKey>> keys;

  std::int64_t tile_count() const { return static_cast<std::int64_t>(wavefront.tiles.size()); }
};

// Tiles with data, both roots, and the parent of every tile. Throws UsageError when the format
// cannot hold a zoom's tolerance (height_step_for).
BuildPlan plan_build(const BuildOptions& options, const Survey& survey);

}  // namespace qmpipe
