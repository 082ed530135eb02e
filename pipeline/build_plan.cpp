#include "pipeline/build_plan.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>
#include <unordered_map>

#include "formats/errors.h"
#include "pipeline/version.h"
#include "stages/height_step.h"
#include "stages/tin.h"

namespace qmpipe {
namespace {

std::vector<std::vector<TileKey>> tiles_to_build(const BuildOptions& options,
                                                 const Survey& survey) {
  std::vector<std::vector<TileKey>> keys(static_cast<std::size_t>(survey.max_zoom) + 1);
  std::set<TileKey> parents;
  for (std::int32_t zoom = survey.max_zoom; zoom >= options.mesh.min_zoom; --zoom) {
    std::set<TileKey> here = std::move(parents);
    parents.clear();
    for (const SurveyedTile& tile : survey.tiles[static_cast<std::size_t>(zoom)]) {
      here.insert(tile.key);
    }
    if (zoom == 0) {
      for (const TileKey& root : survey.scheme.roots()) here.insert(root);
    } else {
      for (const TileKey& key : here) parents.insert(parent_of(key));
    }
    keys[static_cast<std::size_t>(zoom)].assign(here.begin(), here.end());
  }
  return keys;
}

// An upper bound of the height range of any tile of a zoom, voids filled. What fills a void comes
// from posts less than 128 posts away, so from the eight tiles around, or is the base height.
class RangeBound {
 public:
  RangeBound(const BuildOptions& options, const Survey& survey, std::int32_t zoom)
      : options_(options), scheme_(survey.scheme) {
    // A pole without data here takes its height from a coarser zoom.
    const std::int32_t coarsest = std::max(0, zoom - options.mesh.voids.pull_levels);
    for (std::int32_t up = zoom; up >= coarsest; --up) {
      for (const auto& pole : survey.pole_heights[static_cast<std::size_t>(up)]) {
        if (pole) poles_m_.push_back(static_cast<double>(*pole));
      }
    }
    for (const SurveyedTile& tile : survey.tiles[static_cast<std::size_t>(zoom)]) {
      tiles_.emplace(tile.key, &tile);
    }
  }

  double of(const TileKey& key) const {
    const SurveyedTile* own = find(key);
    if (own != nullptr && own->valid_posts == static_cast<std::int32_t>(kTilePostCount)) {
      return static_cast<double>(own->highest_m) - static_cast<double>(own->lowest_m);
    }
    double low_m = options_.mesh.voids.base_height_m;
    double high_m = low_m;
    // A pole's height is the mean of its whole row, which may lie outside the range near the tile.
    for (const double pole_m : poles_m_) {
      low_m = std::min(low_m, pole_m);
      high_m = std::max(high_m, pole_m);
    }
    for (std::int32_t dy = -1; dy <= 1; ++dy) {
      for (std::int32_t dx = -1; dx <= 1; ++dx) {
        const std::int32_t columns = scheme_.columns(key.zoom);
        const SurveyedTile* tile =
            find({.zoom = key.zoom, .x = (key.x + dx + columns) % columns, .y = key.y + dy});
        if (tile == nullptr) continue;
        low_m = std::min(low_m, static_cast<double>(tile->lowest_m));
        high_m = std::max(high_m, static_cast<double>(tile->highest_m));
      }
    }
    return high_m - low_m;
  }

 private:
  const SurveyedTile* find(const TileKey& key) const {
    const auto it = tiles_.find(key);
    return it == tiles_.end() ? nullptr : it->second;
  }

  const BuildOptions& options_;
  const TilingScheme& scheme_;
  std::vector<double> poles_m_;
  std::unordered_map<TileKey, const SurveyedTile*, TileKeyHash> tiles_;
};

double largest_range_m(const BuildOptions& options, const Survey& survey, std::int32_t zoom,
                       const std::vector<TileKey>& keys) {
  const RangeBound bound(options, survey, zoom);
  double largest_m = 0;
  for (const TileKey& key : keys) largest_m = std::max(largest_m, bound.of(key));
  return largest_m;
}

Recipe recipe_for(const BuildOptions& options, const Survey& survey,
                  const std::vector<std::vector<TileKey>>& keys) {
  Recipe recipe;
  recipe.program_version = kProgramVersion;
  recipe.projection = options.mesh.projection;
  recipe.sampling_zoom = survey.sampling_zoom;
  recipe.min_zoom = options.mesh.min_zoom;
  recipe.max_zoom = survey.max_zoom;
  recipe.source_crs = options.input.source_crs;
  recipe.resampling = options.input.resampling;
  recipe.reduction = options.mesh.reduction;
  recipe.voids = options.mesh.voids;
  recipe.method = options.mesh.method;
  recipe.stop = options.mesh.stop;
  recipe.normals = options.encode.normals;
  for (std::int32_t zoom = 0; zoom <= survey.max_zoom; ++zoom) {
    const double tolerance_m = tolerance_at(options.mesh, zoom);
    const Result<double> step = height_step_for(
        tolerance_m, largest_range_m(options, survey, zoom, keys[static_cast<std::size_t>(zoom)]));
    if (!step) {
      throw UsageError(fmt::format("--tolerance at zoom {}: {}", zoom, step.error().message));
    }
    recipe.tolerance_m.push_back(tolerance_m);
    recipe.height_step_m.push_back(*step);
    for (const auto& [name, value] : parameters_at(options.mesh, zoom)) {
      if (name != "g_e") recipe.parameters[name].push_back(value);
    }
  }
  return recipe;
}

}  // namespace

BuildPlan plan_build(const BuildOptions& options, const Survey& survey) {
  BuildPlan plan;
  plan.keys = tiles_to_build(options, survey);
  plan.recipe = recipe_for(options, survey, plan.keys);
  std::vector<TileKey> all;
  for (const auto& keys : plan.keys) all.insert(all.end(), keys.begin(), keys.end());
  plan.wavefront = plan_wavefront(survey.scheme, all);
  return plan;
}

}  // namespace qmpipe
