#include "pipeline/survey/height_spans.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <unordered_map>

#include "stages/posts/heightfield.h"

namespace qmpipe {
namespace {

HeightSpan span_of_posts(const Heightfield& heightfield, const TileKey& key) {
  const WindowHeights window = heightfield.window(key.zoom, Lattice::tile_window(key, 0));
  const auto [low, high] = std::minmax_element(window.heights_m.begin(), window.heights_m.end());
  return {.low_m = static_cast<double>(*low), .high_m = static_cast<double>(*high)};
}

}  // namespace

std::vector<ZoomHeights> heights_by_zoom(const Survey& survey, const VoidPolicy& policy,
                                         const std::vector<std::vector<TileKey>>& keys,
                                         std::int32_t threads) {
  const Heightfield heightfield(*survey.store, survey.scheme, policy, survey.pole_heights);
  tbb::task_arena arena(threads);
  std::vector<ZoomHeights> zooms(keys.size());
  for (std::size_t zoom = 0; zoom < keys.size(); ++zoom) {
    std::unordered_map<TileKey, const SurveyedTile*, TileKeyHash> surveyed;
    for (const SurveyedTile& tile : survey.tiles[zoom]) surveyed.emplace(tile.key, &tile);
    std::vector<HeightSpan> spans(keys[zoom].size());
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, spans.size(), [&](std::size_t k) {
        const auto found = surveyed.find(keys[zoom][k]);
        const SurveyedTile* tile = found == surveyed.end() ? nullptr : found->second;
        const bool is_full = tile != nullptr && tile->valid_posts == kTilePosts * kTilePosts;
        spans[k] = is_full ? HeightSpan{.low_m = static_cast<double>(tile->lowest_m),
                                        .high_m = static_cast<double>(tile->highest_m)}
                           : span_of_posts(heightfield, keys[zoom][k]);
      });
    });
    for (const HeightSpan& span : spans) {
      zooms[zoom].largest_range_m = std::max(zooms[zoom].largest_range_m, span.range_m());
      zooms[zoom].reach_m = std::max(zooms[zoom].reach_m, span.reach_m());
    }
  }
  return zooms;
}

}  // namespace qmpipe
