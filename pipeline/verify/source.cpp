#include "pipeline/verify/source.h"

#include <fmt/format.h>
#include <oneapi/tbb/enumerable_thread_specific.h>
#include <oneapi/tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "formats/sources/raster_source.h"
#include "pipeline/build/build_plan.h"
#include "pipeline/build/estimate.h"
#include "pipeline/common/scratch_folder.h"
#include "pipeline/survey/block_cover.h"
#include "pipeline/survey/memory_share.h"
#include "pipeline/survey/survey.h"
#include "stages/finish/finer_error.h"
#include "stages/posts/height_step.h"
#include "stages/posts/sampling.h"

namespace qmpipe::verify {
namespace {

class SurveyedPosts final : public SourcePosts {
 public:
  // `scratch`, where the deepest zooms' lattice lies when memory is short, lives as long as this.
  SurveyedPosts(Recipe recipe, Survey survey, std::unique_ptr<ScratchFolder> scratch)
      : scratch_(std::move(scratch)),
        recipe_(std::move(recipe)),
        survey_(std::move(survey)),
        heightfield_(*survey_.store, survey_.scheme, recipe_.voids, survey_.pole_heights),
        own_blocks_(covered_blocks(survey_.scheme, survey_.sampling_zoom, survey_.sources)) {
    std::erase_if(own_blocks_,
                  [this](const BlockKey& block) { return !survey_.store->has_block(block); });
  }

  std::optional<WindowHeights> posts(const TileKey& key) const override {
    if (key.zoom > survey_.sampling_zoom) return std::nullopt;
    return heightfield_.window(key.zoom, Lattice::tile_window(key, 0));
  }
  std::optional<double> tolerance_m(std::int32_t zoom) const override {
    return recipe_.error_bound_m(zoom);
  }
  double relief_near_m(const TileKey& key) const override {
    const auto& tiles = survey_.tiles[static_cast<std::size_t>(key.zoom)];
    const std::int32_t columns = survey_.scheme.columns(key.zoom);
    std::optional<HeightSpan> heights;
    for (std::int32_t k = 0; k < 9; ++k) {
      const TileKey near = {
          .zoom = key.zoom, .x = (key.x + k % 3 - 1 + columns) % columns, .y = key.y + k / 3 - 1};
      const auto found = std::lower_bound(
          tiles.begin(), tiles.end(), near,
          [](const SurveyedTile& tile, const TileKey& wanted) { return tile.key < wanted; });
      if (found == tiles.end() || found->key != near) continue;
      const HeightSpan own = {.low_m = static_cast<double>(found->lowest_m),
                              .high_m = static_cast<double>(found->highest_m)};
      include(heights, own);
    }
    return heights ? heights->range_m() : 0;
  }
  std::optional<ErrorSummary> own_error(const TileKey& key,
                                        const QuantizedMesh& mesh) const override {
    if (key.zoom > survey_.sampling_zoom) return std::nullopt;
    const TileSurface surface(survey_.scheme, key, mesh);
    const Lattice lattice(survey_.scheme, survey_.sampling_zoom);
    const std::vector<BlockKey> blocks = own_blocks_in(key);
    std::vector<ErrorSummary> parts(blocks.size());
    // A coarse tile holds most of the source.
    tbb::parallel_for(std::size_t{0}, blocks.size(), [&](std::size_t k) {
      std::vector<float> heights_m(kBlockSize);
      survey_.store->read(lattice, posts_of(blocks[k]), heights_m);
      parts[k] = surface.error(lattice.zoom(), posts_of(blocks[k]), heights_m);
    });
    ErrorSummary all;
    for (const ErrorSummary& part : parts) all.add(part);
    return all;
  }
  std::vector<TileKey> expected_tiles() const override {
    std::vector<TileKey> keys;
    for (const std::vector<SurveyedTile>& zoom : survey_.tiles) {
      for (const SurveyedTile& tile : zoom) {
        if (tile.key.zoom < recipe_.min_zoom) continue;
        if (is_wanted(recipe_.voids, survey_.scheme, tile)) keys.push_back(tile.key);
      }
    }
    return keys;
  }
  const std::vector<RasterInfo>& sources() const override { return survey_.sources; }

 private:
  std::vector<BlockKey> own_blocks_in(const TileKey& key) const {
    const std::int32_t levels = survey_.sampling_zoom - key.zoom;
    // Rows first, as keys are sorted.
    const TileKey first = {.zoom = survey_.sampling_zoom, .x = 0, .y = key.y << levels};
    std::vector<BlockKey> blocks;
    for (auto it = std::lower_bound(own_blocks_.begin(), own_blocks_.end(), first);
         it != own_blocks_.end() && it->y >> levels == key.y; ++it) {
      if (it->x >> levels == key.x) blocks.push_back(*it);
    }
    return blocks;
  }

  std::unique_ptr<ScratchFolder> scratch_;
  Recipe recipe_;
  Survey survey_;
  Heightfield heightfield_;
  std::vector<BlockKey> own_blocks_;  // of the sampling zoom, with data; sorted
};

class SampledPosts final : public SourcePosts {
 public:
  SampledPosts(const SourceOptions& options, std::vector<RasterInfo> sources,
               const TilingScheme& scheme)
      : sources_(std::make_shared<const std::vector<RasterInfo>>(std::move(sources))),
        scheme_(scheme),
        samplers_([this, options] { return open_sampler(options); }) {}

  std::optional<WindowHeights> posts(const TileKey& key) const override {
    const Lattice lattice(scheme_, key.zoom);
    WindowHeights heights;
    heights.window = Lattice::tile_window(key, 0);
    heights.heights_m.assign(heights.window.size(), 0.0F);
    heights.valid.assign(heights.window.size(), 0);
    Sampler& sampler = *samplers_.local();
    if (!sampler.may_cover(lattice, heights.window)) return heights;
    sampler.sample(lattice, heights.window, heights.heights_m);
    std::transform(heights.heights_m.begin(), heights.heights_m.end(), heights.valid.begin(),
                   [](float h) { return static_cast<std::uint8_t>(std::isnan(h) ? 0 : 1); });
    return heights;
  }
  std::optional<double> tolerance_m(std::int32_t) const override { return std::nullopt; }
  double relief_near_m(const TileKey& /*key*/) const override { return 0; }
  std::optional<ErrorSummary> own_error(const TileKey&, const QuantizedMesh&) const override {
    return std::nullopt;
  }
  std::vector<TileKey> expected_tiles() const override { return {}; }
  const std::vector<RasterInfo>& sources() const override { return *sources_; }

 private:
  std::unique_ptr<Sampler> open_sampler(const SourceOptions& options) const {
    const OpenOptions open = {.crs_override = options.source_crs, .heights = options.heights};
    return std::make_unique<Sampler>(
        SourcePool(sources_, open, sources_open_at_once(options.threads)), Resampling::kBilinear);
  }

  std::shared_ptr<const std::vector<RasterInfo>> sources_;
  TilingScheme scheme_;
  // A sampler belongs to one thread; each thread opens its own when it first needs it.
  mutable tbb::enumerable_thread_specific<std::unique_ptr<Sampler>> samplers_;
};

// What a set names and gives no value for.
void note_untold(const HeightOptions& given, const std::vector<std::string>& names,
                 Progress& progress) {
  for (const std::string& name : names) {
    if (has_option(given.config, name) || has_option(given.open_options, name)) continue;
    progress.note(
        fmt::format("the set was built with a value for {0} that it does not tell: give the same "
                    "--config or --oo {0}=VALUE here, or heights may differ",
                    name));
  }
}

}  // namespace

std::unique_ptr<SourcePosts> open_source_posts(const SourceOptions& options,
                                               const TilingScheme& scheme,
                                               const std::optional<Recipe>& recipe,
                                               Progress& progress) {
  SurveyChoice survey = {.inputs = options.inputs, .source_crs = options.source_crs};
  survey.threads = options.threads;
  survey.open_sources = sources_open_at_once(options.threads);
  if (recipe && survey.source_crs.empty()) survey.source_crs = recipe->source_crs;
  if (recipe) note_untold(options.heights, recipe->heights.config, progress);
  survey.heights = recipe ? options.heights.or_else(recipe->heights) : options.heights;
  // An input that cannot be opened is told before work starts.
  std::vector<RasterInfo> sources = describe_inputs(survey);
  if (!recipe) return std::make_unique<SampledPosts>(options, std::move(sources), scheme);
  survey.resampling = recipe->resampling;
  survey.reduction = recipe->reduction;
  survey.scheme = scheme;
  survey.sampling_zoom = recipe->sampling_zoom;
  survey.max_zoom = recipe->max_zoom;
  const MemoryShare memory = MemoryDivisions({}, survey, sources).best();
  SurveyPlace place;
  std::unique_ptr<ScratchFolder> scratch;
  if (memory.store_bytes > 0) {
    scratch = std::make_unique<ScratchFolder>("");
    place.store_folder = scratch->path();
    progress.note(fmt::format("the lattice is kept in {}: at most {} of disk",
                              place.store_folder.string(), bytes_text(memory.store_bytes)));
  }
  Survey surveyed = run_survey(survey, memory, place, std::move(sources), nullptr, progress);
  return std::make_unique<SurveyedPosts>(*recipe, std::move(surveyed), std::move(scratch));
}

}  // namespace qmpipe::verify
