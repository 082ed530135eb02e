// From a survey to everything that is fixed before the first tile is meshed: which tiles, in which
// order, with which tolerance and height step.
#pragma once

#include <string>
#include <vector>

#include "pipeline/recipe/build_options.h"
#include "pipeline/recipe/recipe.h"
#include "pipeline/survey/survey.h"
#include "scheduler/wavefront.h"

namespace qmpipe {

struct BuildPlan {
  Recipe recipe;
  WavefrontPlan wavefront;
  // By zoom, 0..max_zoom; empty below min_zoom. Sorted.
  std::vector<std::vector<TileKey>> keys;
  // What was decided otherwise than the options' defaults say; each a sentence without a full stop.
  std::vector<std::string> notes;

  std::int64_t tile_count() const { return static_cast<std::int64_t>(wavefront.tiles.size()); }
};

// Whether a tile with data is written for its own sake: with VoidPolicy::Kind::kOmit only one without
// voids, pole rows aside.
bool is_wanted(const VoidPolicy& policy, const TilingScheme& scheme, const SurveyedTile& tile);

// Wanted tiles, both roots, and the parent of every tile. Where the format cannot hold a zoom's tolerance
// (height_step_for), a default one is raised to the least that works, and noted; of one that was given,
// UsageError tells an option that works. Throws IoError when the lattice cannot be read.
BuildPlan plan_build(const BuildOptions& options, const Survey& survey);

}  // namespace qmpipe
