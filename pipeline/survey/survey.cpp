#include "pipeline/survey/survey.h"

#include <oneapi/tbb/enumerable_thread_specific.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <set>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/raster/block_cache.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "formats/run_store/tiered_lattice_store.h"
#include "formats/sources/source_pool.h"
#include "pipeline/common/stopwatch.h"
#include "pipeline/survey/block_cover.h"
#include "pipeline/survey/data_rim.h"
#include "pipeline/survey/in_order.h"
#include "pipeline/survey/keep_survey.h"
#include "pipeline/survey/sampling_order.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

void keep_present(const LatticeStore& store, std::vector<BlockKey>& blocks) {
  std::erase_if(blocks, [&store](const BlockKey& block) { return !store.has_block(block); });
}

class Surveyor {
 public:
  Surveyor(const SurveyChoice& choice, const MemoryShare& memory, const SurveyPlace& place,
           std::vector<RasterInfo> sources, std::shared_ptr<HeightTally> tally, Progress& progress)
      : choice_(choice),
        memory_(memory),
        place_(place),
        tally_(std::move(tally)),
        progress_(progress) {
    survey_.sources = std::move(sources);
  }

  Survey run();

 private:
  std::int32_t threads() const { return memory_.plan.sampling_threads; }
  bool is_on_disk(std::int32_t zoom) const { return zoom > memory_.last_memory_zoom; }
  void make_store();
  std::unique_ptr<Sampler> open_sampler(std::shared_ptr<const std::vector<RasterInfo>> sources,
                                        std::shared_ptr<SourceBlockCache> cache) const;
  bool is_done_already(const BlockKey& block) const;
  bool take_from_record(std::vector<BlockKey>& blocks, std::int32_t zoom);
  void survey_zoom(std::vector<BlockKey>& blocks, std::int32_t zoom);
  void write_down(std::int32_t zoom);
  void sample(std::vector<BlockKey>& blocks);
  void reduce_to(std::vector<BlockKey>& blocks, std::int32_t zoom);
  void settle_poles(const std::vector<BlockKey>& blocks, std::int32_t zoom);
  std::optional<float> settle_pole(const std::vector<BlockKey>& blocks, const Lattice& lattice,
                                   std::int64_t j) const;
  void list_tiles(const std::vector<BlockKey>& blocks, std::int32_t zoom);
  SurveyedTile examine(const TileKey& key) const;
  std::int64_t count_posts(std::vector<BlockKey> blocks);
  std::int64_t begin_step(std::int32_t zoom, std::size_t count);

  const SurveyChoice& choice_;
  const MemoryShare& memory_;
  const SurveyPlace& place_;
  std::shared_ptr<HeightTally> tally_;
  Progress& progress_;
  Survey survey_;
  std::vector<std::int64_t> posts_of_zoom_;  // at most
};

std::unique_ptr<Sampler> Surveyor::open_sampler(
    std::shared_ptr<const std::vector<RasterInfo>> sources,
    std::shared_ptr<SourceBlockCache> cache) const {
  return std::make_unique<Sampler>(SourcePool(std::move(sources),
                                              {.crs_override = choice_.source_crs,
                                               .heights = choice_.heights,
                                               .tally = tally_,
                                               .cache = std::move(cache)},
                                              choice_.open_sources),
                                   choice_.resampling);
}

void Surveyor::make_store() {
  const std::int32_t max_zoom = survey_.sampling_zoom;
  survey_.store = make_memory_lattice_store(choice_.scheme, max_zoom);
  if (memory_.last_memory_zoom >= max_zoom) return;
  auto disk =
      open_hdf5_lattice_store(place_.store_folder, choice_.scheme,
                              {.max_zoom = max_zoom, .cache_bytes = memory_.block_cache_bytes});
  if (!disk) {
    throw IoError("cannot keep the lattice in", place_.store_folder.string(), disk.error().message,
                  "remove the folder and run again");
  }
  survey_.disk = disk->get();
  survey_.store = make_tiered_lattice_store(std::move(survey_.store), memory_.last_memory_zoom,
                                            std::move(disk.value()));
}

// By zoom, and in all.
std::int64_t Surveyor::count_posts(std::vector<BlockKey> blocks) {
  std::int64_t all = 0;
  posts_of_zoom_.resize(static_cast<std::size_t>(survey_.sampling_zoom) + 1);
  for (std::int32_t zoom = survey_.sampling_zoom; zoom >= 0; --zoom) {
    if (zoom < survey_.sampling_zoom) blocks = coarser_blocks(survey_.scheme, blocks);
    const auto posts = std::ssize(blocks) * static_cast<std::int64_t>(kBlockSize);
    posts_of_zoom_[static_cast<std::size_t>(zoom)] = posts;
    all += posts;
  }
  return all;
}

// A zoom's posts count half when they are made and half when its tiles are looked at: about as long as
// both take. Returns by how much progress advances for each of `count` parts.
std::int64_t Surveyor::begin_step(std::int32_t zoom, std::size_t count) {
  const std::int64_t half = posts_of_zoom_[static_cast<std::size_t>(zoom)] / 2;
  const std::int64_t each = count == 0 ? 0 : half / static_cast<std::int64_t>(count);
  progress_.skip(half - each * static_cast<std::int64_t>(count));
  return each;
}

void Surveyor::sample(std::vector<BlockKey>& blocks) {
  const Lattice lattice(survey_.scheme, survey_.sampling_zoom);
  const auto cache = std::make_shared<SourceBlockCache>(memory_.plan.source_cache_bytes);
  // The rest of the survey goes by the order of the keys.
  std::vector<BlockKey> order = blocks;
  sort_for_sampling(
      order, widest_strip(lattice, survey_.sources, threads(), memory_.plan.source_cache_bytes));
  const auto sources = std::make_shared<const std::vector<RasterInfo>>(survey_.sources);
  // GDAL's datasets belong to one thread; each opens its own.
  tbb::enumerable_thread_specific<std::unique_ptr<Sampler>> samplers(
      [&] { return open_sampler(sources, cache); });
  const std::int64_t step = begin_step(survey_.sampling_zoom, order.size());
  for_each_in_order(threads(), order.size(), [&](std::size_t k) {
    progress_.check_stop();
    const BlockKey& block = order[k];
    if (is_done_already(block)) {
      progress_.skip(step);
      return;
    }
    const PostWindow window = posts_of(block);
    std::vector<float> heights_m(kBlockSize);
    Sampler& sampler = *samplers.local();
    if (sampler.may_cover(lattice, window)) {
      sampler.sample(lattice, window, heights_m);
      survey_.store->put_block(block, heights_m);
    }
    progress_.advance(step);
  });
  survey_.source_reads = cache->reads();
  keep_present(*survey_.store, blocks);
}

void Surveyor::reduce_to(std::vector<BlockKey>& blocks, std::int32_t zoom) {
  const std::int64_t step = begin_step(zoom, blocks.size());
  for_each_in_order(threads(), blocks.size(), [&](std::size_t k) {
    progress_.check_stop();
    const BlockKey& block = blocks[k];
    if (is_done_already(block)) {
      progress_.skip(step);
      return;
    }
    std::vector<float> heights_m(kBlockSize);
    reduce_block(*survey_.store, survey_.scheme, block, choice_.reduction, heights_m);
    survey_.store->put_block(block, heights_m);
    progress_.advance(step);
  });
  keep_present(*survey_.store, blocks);
}

// All posts of a pole row are one point of the globe: they get the mean of those that are valid.
std::optional<float> Surveyor::settle_pole(const std::vector<BlockKey>& blocks,
                                           const Lattice& lattice, std::int64_t j) const {
  const std::int32_t zoom = lattice.zoom();
  std::vector<float> block_m(kBlockSize);
  const auto row = block_m.begin() + j % kBlockPosts * kBlockPosts;
  double sum_m = 0;
  std::int64_t count = 0;
  for (const BlockKey& block : blocks) {
    if (block.zoom != zoom || block.y != block_of_post(j)) continue;
    survey_.store->read(lattice, posts_of(block), block_m);
    std::for_each(row, row + kBlockPosts, [&](float h) {
      if (std::isnan(h)) return;
      sum_m += static_cast<double>(h);
      ++count;
    });
  }
  if (count == 0) return std::nullopt;
  const auto height_m = static_cast<float>(sum_m / static_cast<double>(count));
  for (const BlockKey& block : blocks) {
    if (block.zoom != zoom || block.y != block_of_post(j)) continue;
    survey_.store->read(lattice, posts_of(block), block_m);
    std::replace_if(
        row, row + kBlockPosts, [](float h) { return !std::isnan(h); }, height_m);
    survey_.store->put_block(block, block_m);
  }
  return height_m;
}

void Surveyor::settle_poles(const std::vector<BlockKey>& blocks, std::int32_t zoom) {
  const Lattice lattice(survey_.scheme, zoom);
  PoleHeights& poles = survey_.pole_heights[static_cast<std::size_t>(zoom)];
  if (!lattice.is_pole_row(0)) return;
  poles[0] = settle_pole(blocks, lattice, 0);
  poles[1] = settle_pole(blocks, lattice, lattice.rows() - 1);
}

SurveyedTile Surveyor::examine(const TileKey& key) const {
  const Lattice lattice(survey_.scheme, key.zoom);
  const PostWindow window = Lattice::tile_window(key, 0);
  std::vector<float> heights_m(window.size());
  survey_.store->read(lattice, window, heights_m);
  SurveyedTile tile{.key = key,
                    .lowest_m = std::numeric_limits<float>::max(),
                    .highest_m = std::numeric_limits<float>::lowest()};
  for (std::int32_t j = 0; j < window.height_posts; ++j) {
    if (lattice.is_pole_row(window.j0 + j)) continue;
    const float* row = heights_m.data() + static_cast<std::ptrdiff_t>(j) * window.width_posts;
    for (std::int32_t i = 0; i < window.width_posts; ++i) {
      if (std::isnan(row[i])) continue;
      tile.lowest_m = std::min(tile.lowest_m, row[i]);
      tile.highest_m = std::max(tile.highest_m, row[i]);
      ++tile.valid_posts;
    }
  }
  const bool is_full = tile.valid_posts == kTilePosts * kTilePosts;
  if (tile.valid_posts > 0 && !is_full) tile.rim_m = rim_of(lattice, window, heights_m);
  return tile;
}

void Surveyor::list_tiles(const std::vector<BlockKey>& blocks, std::int32_t zoom) {
  const TilingScheme& scheme = survey_.scheme;
  const std::int32_t columns = scheme.columns(zoom);
  // A block's first row and column lie on the tiles to its south and west too.
  std::set<TileKey> candidates;
  for (const BlockKey& block : blocks) {
    for (const std::int32_t y : {block.y - 1, block.y}) {
      for (const std::int32_t x : {block.x - 1, block.x}) {
        const TileKey key = {.zoom = zoom, .x = (x + columns) % columns, .y = y};
        if (scheme.contains(key)) candidates.insert(key);
      }
    }
  }
  const std::vector<TileKey> keys(candidates.begin(), candidates.end());
  auto& tiles = survey_.tiles[static_cast<std::size_t>(zoom)];
  tiles.resize(keys.size());
  const std::int64_t step = begin_step(zoom, keys.size());
  for_each_in_order(threads(), keys.size(), [&](std::size_t k) {
    progress_.check_stop();
    tiles[k] = examine(keys[k]);
    progress_.advance(step);
  });
  std::erase_if(tiles, [](const SurveyedTile& tile) { return tile.valid_posts == 0; });
}

// By a run that was interrupted while it was at this zoom. Blocks with a pole row are made again:
// that row may or may not have got its one height. (At the sampling zoom it has one from the start.)
bool Surveyor::is_done_already(const BlockKey& block) const {
  if (place_.record == nullptr || !is_on_disk(block.zoom)) return false;
  const Lattice lattice(survey_.scheme, block.zoom);
  const bool has_pole =
      lattice.is_pole_row(0) && (block.y == 0 || block.y == block_of_post(lattice.rows() - 1));
  return !has_pole && survey_.store->has_block(block);
}

// True when an earlier run has finished the zoom.
bool Surveyor::take_from_record(std::vector<BlockKey>& blocks, std::int32_t zoom) {
  if (place_.record == nullptr || !is_on_disk(zoom)) return false;
  if (!place_.record->is_surveyed(zoom)) return false;
  SurveyedZoom surveyed = place_.record->surveyed(zoom, survey_.scheme);
  survey_.pole_heights[static_cast<std::size_t>(zoom)] = surveyed.pole_heights_m;
  if (zoom <= survey_.max_zoom) {
    survey_.tiles[static_cast<std::size_t>(zoom)] = std::move(surveyed.tiles);
  }
  keep_present(*survey_.store, blocks);
  return true;
}

void Surveyor::write_down(std::int32_t zoom) {
  if (place_.record == nullptr || !is_on_disk(zoom)) return;
  survey_.store->seal();
  place_.record->add_surveyed(zoom, zoom_of(survey_, zoom));
}

void Surveyor::survey_zoom(std::vector<BlockKey>& blocks, std::int32_t zoom) {
  if (zoom < survey_.sampling_zoom) blocks = coarser_blocks(survey_.scheme, blocks);
  if (take_from_record(blocks, zoom)) {
    progress_.skip(posts_of_zoom_[static_cast<std::size_t>(zoom)]);
    return;
  }
  if (zoom == survey_.sampling_zoom) {
    sample(blocks);
  } else {
    reduce_to(blocks, zoom);
  }
  settle_poles(blocks, zoom);
  if (zoom <= survey_.max_zoom) {
    list_tiles(blocks, zoom);
  } else {
    begin_step(zoom, 0);
  }
  write_down(zoom);
}

Survey Surveyor::run() {
  const Stopwatch watch;
  survey_.scheme = choice_.scheme;
  survey_.sampling_zoom = chosen_sampling_zoom(choice_, survey_.sources);
  survey_.max_zoom = choice_.max_zoom < 0 ? survey_.sampling_zoom : choice_.max_zoom;
  make_store();
  survey_.pole_heights.resize(static_cast<std::size_t>(survey_.sampling_zoom) + 1);
  survey_.tiles.resize(static_cast<std::size_t>(survey_.max_zoom) + 1);

  std::vector<BlockKey> blocks =
      covered_blocks(survey_.scheme, survey_.sampling_zoom, survey_.sources);
  try {
    const Phase phase(progress_, "survey", "posts", count_posts(blocks));
    for (std::int32_t zoom = survey_.sampling_zoom; zoom >= 0; --zoom) {
      survey_zoom(blocks, zoom);
      survey_.coarsest_done = zoom;
    }
  } catch (const Interrupted&) {
    survey_.store->seal();
    survey_.seconds = watch.seconds();
    keep_survey(survey_, memory_, place_, progress_);
    throw;
  }
  survey_.seconds = watch.seconds();
  return std::move(survey_);
}

}  // namespace

SurveyedZoom zoom_of(const Survey& survey, std::int32_t zoom) {
  const auto at = static_cast<std::size_t>(zoom);
  SurveyedZoom surveyed{.tiles = {}, .pole_heights_m = survey.pole_heights[at]};
  if (zoom <= survey.max_zoom) surveyed.tiles = survey.tiles[at];
  return surveyed;
}

Survey run_survey(const SurveyChoice& choice, const MemoryShare& memory, const SurveyPlace& place,
                  std::vector<RasterInfo> sources, std::shared_ptr<HeightTally> tally,
                  Progress& progress) {
  QMPIPE_CHECK(choice.threads >= 1 && memory.plan.sampling_threads >= 1);
  return Surveyor(choice, memory, place, std::move(sources), std::move(tally), progress).run();
}

}  // namespace qmpipe
