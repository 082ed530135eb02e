#include "pipeline/build/build_plan.h"

#include <fmt/format.h>

#include <map>
#include <set>
#include <string>

#include "formats/bytes/errors.h"
#include "pipeline/common/version.h"
#include "pipeline/survey/data_rim.h"
#include "pipeline/survey/height_spans.h"
#include "stages/posts/height_step.h"
#include "stages/posts/post_grid.h"

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
      if (is_wanted(options.mesh.voids, survey.scheme, tile)) here.insert(tile.key);
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

Recipe recipe_for(const BuildOptions& options, const Survey& survey) {
  Recipe recipe;
  recipe.program_version = kProgramVersion;
  recipe.projection = options.mesh.projection;
  recipe.sampling_zoom = survey.sampling_zoom;
  recipe.min_zoom = options.mesh.min_zoom;
  recipe.max_zoom = survey.max_zoom;
  recipe.source_crs = options.input.source_crs;
  recipe.heights = options.input.heights;
  recipe.resampling = options.input.resampling;
  recipe.reduction = options.mesh.reduction;
  recipe.voids = settled_policy(options.mesh.voids, survey);
  recipe.method = options.mesh.method;
  recipe.stop = options.mesh.stop;
  recipe.normals = options.encode.normals;
  return recipe;
}

bool has_default_tolerance(const MeshOptions& mesh, std::int32_t zoom) {
  return !mesh.tolerance_at_m.contains(zoom) &&
         mesh.parameters.of("g_e") == MethodParameters().of("g_e");
}

// One option line for all zooms whose tolerance is refused.
std::string working_tolerances(const BuildOptions& options,
                               const std::vector<ZoomHeights>& heights) {
  std::map<std::int32_t, double> tolerances = options.mesh.tolerance_at_m;
  for (std::size_t zoom = 0; zoom < heights.size(); ++zoom) {
    const ZoomHeights& here = heights[zoom];
    const auto key = static_cast<std::int32_t>(zoom);
    const double tolerance_m = tolerance_at(options.mesh, key);
    if (height_step_for(tolerance_m, here.largest_range_m, here.reach_m)) continue;
    tolerances[key] = least_tolerance_m(here.largest_range_m, here.reach_m);
  }
  std::string text;
  for (const auto& [zoom, tolerance_m] : tolerances) {
    text += fmt::format("{}{}={:g}", text.empty() ? "" : ",", zoom, tolerance_m);
  }
  return text;
}

// The tolerance and the steps of each zoom. A default tolerance ends at the least that works.
void settle_steps(const BuildOptions& options, const std::vector<ZoomHeights>& heights,
                  BuildPlan& plan) {
  std::string raised;
  for (std::int32_t zoom = 0; zoom <= plan.recipe.max_zoom; ++zoom) {
    const ZoomHeights& here = heights[static_cast<std::size_t>(zoom)];
    double tolerance_m = tolerance_at(options.mesh, zoom);
    Result<double> step = height_step_for(tolerance_m, here.largest_range_m, here.reach_m);
    if (!step && has_default_tolerance(options.mesh, zoom)) {
      tolerance_m = least_tolerance_m(here.largest_range_m, here.reach_m);
      raised += fmt::format("{} {:g} m at zoom {}", raised.empty() ? "" : ",", tolerance_m, zoom);
      step = height_step_for(tolerance_m, here.largest_range_m, here.reach_m);
    }
    if (!step) {
      throw UsageError(
          fmt::format("--tolerance at zoom {}: {}; this works for all zooms:\n"
                      "  --tolerance-at {}",
                      zoom, step.error().message, working_tolerances(options, heights)));
    }
    plan.recipe.tolerance_m.push_back(tolerance_m);
    plan.recipe.height_step_m.push_back(*step);
    for (const auto& [name, value] : parameters_at(options.mesh, zoom)) {
      if (name != "g_e") plan.recipe.parameters[name].push_back(value);
    }
  }
  if (raised.empty()) return;
  plan.notes.push_back(
      "the tolerance does not go on being halved where a tile's heights are too "
      "far apart for the format's 32,768 of them: it is" +
      raised);
}

}  // namespace

bool is_wanted(const VoidPolicy& policy, const TilingScheme& scheme, const SurveyedTile& tile) {
  if (policy.kind != VoidPolicy::Kind::kOmit) return true;
  const Lattice lattice(scheme, tile.key.zoom);
  const PostWindow window = Lattice::tile_window(tile.key, 0);
  const auto rows = [&lattice](std::int64_t j) { return lattice.is_pole_row(j) ? 1 : 0; };
  const int pole_rows = rows(window.j0) + rows(window.j0 + window.height_posts - 1);
  return tile.valid_posts ==
         static_cast<std::int32_t>(kTilePostCount) - pole_rows * window.width_posts;
}

BuildPlan plan_build(const BuildOptions& options, const Survey& survey) {
  BuildPlan plan;
  plan.keys = tiles_to_build(options, survey);
  plan.recipe = recipe_for(options, survey);
  settle_steps(options, heights_by_zoom(survey, plan.recipe.voids, plan.keys, options.run.threads),
               plan);
  std::vector<TileKey> all;
  for (const auto& keys : plan.keys) all.insert(all.end(), keys.begin(), keys.end());
  plan.wavefront = plan_wavefront(survey.scheme, all);
  return plan;
}

}  // namespace qmpipe
