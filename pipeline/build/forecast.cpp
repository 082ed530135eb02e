#include "pipeline/build/forecast.h"

#include <algorithm>

#include "pipeline/common/machine_share.h"
#include "pipeline/survey/block_cover.h"

namespace qmpipe {
namespace {

// On a core of our days, measured with real DEMs. What is wrong with them is put right by the estimate
// and by the phases themselves.
constexpr double kVerifyTileS = 0.002;

double cores_of(std::int32_t threads) { return std::max(1, std::min(threads, usable_threads())); }

}  // namespace

std::int64_t expected_tiles(const BuildOptions& options, const SurveyChoice& survey,
                            const std::vector<RasterInfo>& sources) {
  const std::int32_t deepest =
      options.mesh.max_zoom.value_or(chosen_sampling_zoom(survey, sources));
  std::int64_t tiles = 0;
  for (std::int32_t zoom = options.mesh.min_zoom; zoom <= deepest; ++zoom) {
    tiles += expected_blocks(survey.scheme, zoom, sources);
  }
  return tiles;
}

std::vector<ExpectedPhase> phases_of_build(const BuildOptions& options, const SurveyChoice& survey,
                                           const std::vector<RasterInfo>& sources) {
  const std::int64_t tiles = expected_tiles(options, survey, sources);
  const double tile_s = usual_tile_s(options.mesh.method) / cores_of(options.run.threads);
  return {{.name = "survey"},
          {.name = "estimate", .seconds = static_cast<double>(sampled_tiles(tiles)) * tile_s},
          {.name = "mesh", .seconds = static_cast<double>(tiles) * tile_s}};
}

ExpectedPhase mesh_phase(const Estimate& estimate) {
  double all_s = 0;
  for (const ZoomEstimate& zoom : estimate.zooms) all_s += zoom.seconds;
  // Zooms come one after the other, coarse ones first.
  const auto share = [zooms = estimate.zooms, all_s](std::int64_t done) {
    double done_s = 0;
    for (const ZoomEstimate& zoom : zooms) {
      const std::int64_t here = std::min(done, zoom.tiles);
      done_s += zoom.seconds * static_cast<double>(here) / static_cast<double>(zoom.tiles);
      done -= here;
    }
    return done_s / all_s;
  };
  if (all_s <= 0) return {.name = "mesh"};
  return {.name = "mesh", .seconds = estimate.seconds, .share = share};
}

std::vector<ExpectedPhase> phases_of_verify(std::int64_t tiles, AgainstSource against,
                                            std::int32_t threads) {
  std::vector<ExpectedPhase> phases;
  if (against == AgainstSource::kYes) phases.push_back({.name = "survey"});
  phases.push_back(
      {.name = "verify", .seconds = static_cast<double>(tiles) * kVerifyTileS / cores_of(threads)});
  return phases;
}

}  // namespace qmpipe
