#include "pipeline/verify/verify.h"

#include <fmt/format.h>
#include <oneapi/tbb/global_control.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <span>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/crs/foreign.h"
#include "pipeline/build/forecast.h"
#include "pipeline/recipe/recipe.h"
#include "pipeline/verify/borders.h"
#include "pipeline/verify/outside.h"
#include "pipeline/verify/pixels.h"
#include "pipeline/verify/set.h"
#include "pipeline/verify/source.h"
#include "pipeline/verify/tile.h"
#include "scheduler/check.h"

namespace qmpipe::verify {
namespace {

// Tiles that are examined before the next ones are fetched: enough to keep all threads busy.
constexpr std::size_t kBatchTiles = 1024;

// What is left of a tile when its mesh is gone.
struct TileOutcome {
  TileKey key;
  std::vector<Finding> findings;
  std::int64_t stored_bytes = 0;
  std::int64_t vertices = 0;
  std::int64_t triangles = 0;
  std::optional<TileExtensions> extensions;  // none for a tile that cannot be read
  std::optional<TileBorders> borders;        // none where its heights are no numbers
  ErrorSummary error;
  ErrorSummary source_error;
  std::optional<HausdorffDistances> hausdorff;
  double crack_m = 0;
  std::int64_t border_pairs = 0;
};

bool has_usable_heights(const QuantizedMesh& mesh) {
  const float low = mesh.header.min_height_m;
  const float high = mesh.header.max_height_m;
  return std::isfinite(low) && std::isfinite(high) && low <= high;
}

const TileOutcome* find_tile(const std::vector<TileOutcome>& tiles, const TileKey& key) {
  const auto it = std::lower_bound(
      tiles.begin(), tiles.end(), key,
      [](const TileOutcome& tile, const TileKey& wanted) { return tile.key < wanted; });
  return it != tiles.end() && it->key == key ? &*it : nullptr;
}

class Verification {
 public:
  Verification(const TileSet& tile_set, const VerifyOptions& options, Progress& progress)
      : tile_set_(tile_set),
        options_(options),
        progress_(progress),
        thread_limit_(tbb::global_control::max_allowed_parallelism,
                      static_cast<std::size_t>(options.threads)),
        arena_(options.threads),
        log_(options.most_per_kind) {}

  VerifyReport run();

 private:
  void read_recipe();
  void open_source();
  void look_for_missing_tiles(const std::vector<TileKey>& keys);
  void verify_zoom(std::span<const TileKey> keys);
  TileOutcome examine(const TileKey& key) const;
  void measure(const QuantizedMesh& mesh, TileOutcome& outcome) const;
  void judge_error(TileOutcome& outcome) const;
  void judge_outside(const QuantizedMesh& mesh, std::span<const std::uint8_t> valid,
                     TileOutcome& outcome) const;
  void compare_with_neighbours(const std::vector<TileOutcome>& row_below,
                               std::vector<TileOutcome>& batch);
  void collect(TileOutcome& outcome, ZoomReport& zoom);
  template <class Body>
  void for_each_index(std::size_t count, const Body& body);

  const TileSet& tile_set_;
  const VerifyOptions& options_;
  Progress& progress_;
  // Lets a run have more threads than the machine has cores.
  tbb::global_control thread_limit_;
  tbb::task_arena arena_;
  FindingLog log_;
  CheckedLayer layer_;
  std::optional<Recipe> recipe_;
  std::unique_ptr<SourcePosts> source_;
  ExtensionTallies tallies_;
  VerifyReport report_;
};

template <class Body>
void Verification::for_each_index(std::size_t count, const Body& body) {
  arena_.execute([&] { tbb::parallel_for(std::size_t{0}, count, body); });
}

void Verification::read_recipe() {
  if (!layer_.parsed || layer_.parsed->layer.qmpipe_json.empty()) return;
  Result<Recipe> recipe = parse_recipe(layer_.parsed->layer.qmpipe_json);
  const auto refuse = [this](const std::string& why) {
    log_.add({.kind = FindingKind::kLayerJson, .key = std::nullopt, .text = "\"qmpipe\": " + why});
  };
  if (!recipe) return refuse(recipe.error().message);
  if (recipe->projection != layer_.scheme.projection()) {
    return refuse("its scheme is not the one of \"projection\"");
  }
  // Somebody else's set: its text must not make requests or open files.
  const std::string& crs = recipe->source_crs;
  if (!options_.sources.empty() && options_.source_crs.empty() && !crs.empty()) {
    if (const auto error = fault_of_foreign_crs(crs)) {
      return refuse(fmt::format("its source_crs \"{}\" {}; say which CRS it is with --source-crs",
                                crs.substr(0, 80), error->message));
    }
  }
  recipe_ = std::move(*recipe);
}

void Verification::open_source() {
  if (options_.sources.empty()) return;
  source_ = open_source_posts({.inputs = options_.sources,
                               .source_crs = options_.source_crs,
                               .threads = options_.threads,
                               .heights = options_.heights},
                              layer_.scheme, recipe_, progress_);
}

void Verification::look_for_missing_tiles(const std::vector<TileKey>& keys) {
  if (!source_ || !recipe_) return;
  const std::vector<TileKey> expected = source_->expected_tiles();
  for (const TileKey& key : expected) {
    if (std::binary_search(keys.begin(), keys.end(), key)) continue;
    log_.add({.kind = FindingKind::kMissingTile,
              .key = key,
              .text = "the source has data here, but the set has no tile"});
  }
  // Tiles with a void are left out there.
  if (recipe_->voids.kind == VoidPolicy::Kind::kOmit) return;
  log_.add_all(check_pixels(source_->sources(), options_.heights.or_else(recipe_->heights),
                            *recipe_, keys, expected));
}

VerifyReport Verification::run() {
  layer_ = check_layer(tile_set_);
  log_.add_all(std::move(layer_.findings));
  read_recipe();
  TilesInScheme tiles = tiles_in_scheme(tile_set_, layer_.scheme);
  log_.add_all(std::move(tiles.findings));
  log_.add_all(check_listing(layer_, tiles.keys, tile_set_.strays()));
  const bool surveys = !options_.sources.empty() && recipe_.has_value();
  progress_.expect(phases_of_verify(std::ssize(tiles.keys),
                                    surveys ? AgainstSource::kYes : AgainstSource::kNo,
                                    options_.threads));
  open_source();
  look_for_missing_tiles(tiles.keys);
  {
    const Phase phase(progress_, "verify", "tiles", static_cast<std::int64_t>(tiles.keys.size()));
    const std::span<const TileKey> keys = tiles.keys;
    for (std::size_t at = 0; at < keys.size();) {
      std::size_t end = at;
      while (end < keys.size() && keys[end].zoom == keys[at].zoom) ++end;
      verify_zoom(keys.subspan(at, end - at));
      at = end;
    }
  }
  log_.add_all(check_extensions(layer_, tallies_));
  report_.has_source = source_ != nullptr;
  report_.hausdorff = options_.hausdorff;
  report_.tiles = static_cast<std::int64_t>(tiles.keys.size());
  report_.faults = log_.sorted(Severity::kFault);
  report_.warnings = log_.sorted(Severity::kWarning);
  report_.fault_count = log_.total(Severity::kFault);
  report_.warning_count = log_.total(Severity::kWarning);
  for (std::size_t k = 0; k < kFindingKinds; ++k) {
    report_.counts[k] = log_.count(static_cast<FindingKind>(k));
  }
  return std::move(report_);
}

// Batches of whole rows: a tile's east neighbour is in its batch (across the antimeridian too), its
// south neighbour there or in the last row of the batch before.
void Verification::verify_zoom(std::span<const TileKey> keys) {
  ZoomReport zoom;
  zoom.zoom = keys.front().zoom;
  if (source_) zoom.tolerance_m = source_->tolerance_m(zoom.zoom);
  std::vector<TileOutcome> row_below;
  for (std::size_t at = 0; at < keys.size();) {
    std::size_t end = std::min(at + kBatchTiles, keys.size());
    while (end < keys.size() && keys[end].y == keys[end - 1].y) ++end;
    std::vector<TileOutcome> batch(end - at);
    for_each_index(batch.size(), [&](std::size_t k) {
      progress_.check_stop();
      batch[k] = examine(keys[at + k]);
      progress_.advance(1);
    });
    compare_with_neighbours(row_below, batch);
    for (TileOutcome& outcome : batch) collect(outcome, zoom);
    std::erase_if(batch, [last_row = keys[end - 1].y](const TileOutcome& outcome) {
      return outcome.key.y != last_row;
    });
    row_below = std::move(batch);
    at = end;
  }
  report_.zooms.push_back(zoom);
}

TileOutcome Verification::examine(const TileKey& key) const {
  TileOutcome outcome;
  outcome.key = key;
  const Result<std::int64_t> size = tile_set_.stored_bytes(key);
  outcome.stored_bytes = size ? *size : 0;
  // Clients read our occlusion point or not: we promise that it is right.
  const OcclusionRule rule = recipe_ ? OcclusionRule::kAlwaysRight : OcclusionRule::kRightWhereRead;
  CheckedTile checked = check_tile(layer_.scheme, key, tile_set_.read(key), rule);
  outcome.findings = std::move(checked.findings);
  if (!checked.mesh) return outcome;
  const QuantizedMesh& mesh = *checked.mesh;
  outcome.vertices = static_cast<std::int64_t>(mesh.vertex_count());
  outcome.triangles = static_cast<std::int64_t>(mesh.triangle_count());
  outcome.extensions = extensions_of(mesh);
  if (!has_usable_heights(mesh)) return outcome;
  outcome.borders = borders_of(mesh);
  measure(mesh, outcome);
  return outcome;
}

void Verification::measure(const QuantizedMesh& mesh, TileOutcome& outcome) const {
  if (!source_) return;
  const std::optional<WindowHeights> posts = source_->posts(outcome.key);
  if (!posts) {
    outcome.findings.push_back({.kind = FindingKind::kNotChecked,
                                .key = outcome.key,
                                .text = "deeper than the recipe's sampling zoom, so its heights "
                                        "were not compared with the source"});
    return;
  }
  const PostGrid grid = make_tile_grid(layer_.scheme, outcome.key);
  outcome.error = measure_error(grid, mesh, posts->heights_m, posts->valid);
  judge_error(outcome);
  outcome.source_error = source_->own_error(outcome.key, mesh).value_or(ErrorSummary());
  const bool has_voids = std::count(posts->valid.begin(), posts->valid.end(), 0) > 0;
  if (has_voids) judge_outside(mesh, posts->valid, outcome);
  if (options_.hausdorff == HausdorffMode::kMeasured && !has_voids && mesh.triangle_count() > 0) {
    outcome.hausdorff = tile_hausdorff(layer_.scheme, outcome.key, mesh, posts->heights_m);
  }
}

void Verification::judge_error(TileOutcome& outcome) const {
  const std::optional<double> tolerance_m = source_->tolerance_m(outcome.key.zoom);
  const ErrorSummary& error = outcome.error;
  if (!tolerance_m || error.largest_m <= *tolerance_m) return;
  const PostGrid grid = make_tile_grid(layer_.scheme, outcome.key);
  outcome.findings.push_back(
      {.kind = FindingKind::kTolerance,
       .key = outcome.key,
       .text =
           fmt::format("the post at longitude {:.6f}, latitude {:.6f} (column {}, row {} of the "
                       "tile) is {:.6g} m from the surface, more than the tolerance of {:.6g} m",
                       grid.longitude_deg[static_cast<std::size_t>(error.worst.i)],
                       grid.latitude_deg[static_cast<std::size_t>(error.worst.j)], error.worst.i,
                       error.worst.j, error.largest_m, *tolerance_m)});
}

// Only where the recipe promises something: a height that somebody wants outside the data may be a cliff.
void Verification::judge_outside(const QuantizedMesh& mesh, std::span<const std::uint8_t> valid,
                                 TileOutcome& outcome) const {
  const TileKey& key = outcome.key;
  const std::optional<double> tolerance_m = source_->tolerance_m(key.zoom);
  if (!recipe_ || !tolerance_m || recipe_->voids.kind == VoidPolicy::Kind::kHeight) return;
  const auto adopt = [&outcome](std::vector<Finding> findings) {
    std::move(findings.begin(), findings.end(), std::back_inserter(outcome.findings));
  };
  const TileOutside tile = {.key = key, .mesh = mesh, .valid = valid, .tolerance_m = *tolerance_m};
  if (recipe_->voids.fade_m == 0) {
    adopt(find_cliff(layer_.scheme, tile, source_->relief_near_m(key)));
  }
  if (key.zoom <= std::max(recipe_->voids.base_zoom, recipe_->min_zoom)) return;
  const auto stored = tile_set_.read(parent_of(key));
  if (!stored) return;
  const auto plain = plain_tile_bytes(*stored);
  if (!plain) return;
  const Result<QuantizedMesh> parent = decode(*plain);
  if (!parent || !has_usable_heights(*parent)) return;
  adopt(find_levels_apart(layer_.scheme, tile,
                          {.key = parent_of(key),
                           .mesh = *parent,
                           .valid = {},
                           .tolerance_m = source_->tolerance_m(key.zoom - 1).value_or(0)}));
}

void Verification::compare_with_neighbours(const std::vector<TileOutcome>& row_below,
                                           std::vector<TileOutcome>& batch) {
  std::vector<std::vector<BorderComparison>> comparisons(batch.size());
  for_each_index(batch.size(), [&](std::size_t k) {
    const TileOutcome& tile = batch[k];
    if (!tile.borders) return;
    for (const Side side : {Side::kEast, Side::kSouth}) {
      const std::optional<TileKey> key = layer_.scheme.neighbour(tile.key, side);
      if (!key) continue;
      const TileOutcome* neighbour = find_tile(batch, *key);
      if (neighbour == nullptr) neighbour = find_tile(row_below, *key);
      if (neighbour == nullptr || !neighbour->borders) continue;
      comparisons[k].push_back(
          compare_borders(layer_.scheme, tile.key, *tile.borders, side, *key, *neighbour->borders));
    }
  });
  for (std::size_t k = 0; k < batch.size(); ++k) {
    for (BorderComparison& comparison : comparisons[k]) {
      batch[k].crack_m = std::max(batch[k].crack_m, comparison.crack_m);
      ++batch[k].border_pairs;
      std::move(comparison.findings.begin(), comparison.findings.end(),
                std::back_inserter(batch[k].findings));
    }
  }
}

void Verification::collect(TileOutcome& outcome, ZoomReport& zoom) {
  log_.add_all(std::move(outcome.findings));
  ++zoom.tiles;
  zoom.stored_bytes += outcome.stored_bytes;
  zoom.borders += outcome.border_pairs;
  zoom.largest_crack_m = std::max(zoom.largest_crack_m, outcome.crack_m);
  report_.largest_crack_m = std::max(report_.largest_crack_m, outcome.crack_m);
  if (!outcome.extensions) return;
  ++zoom.readable_tiles;
  zoom.vertices += outcome.vertices;
  zoom.triangles += outcome.triangles;
  add_tile(layer_, outcome.key, *outcome.extensions, tallies_);
  if (outcome.error.largest_m > zoom.error.largest_m) zoom.worst_tile = outcome.key;
  zoom.error.add(outcome.error);
  zoom.source_error.add(outcome.source_error);
  if (outcome.hausdorff) {
    zoom.measured.push_back({outcome.key, outcome.vertices, outcome.triangles, *outcome.hausdorff});
  }
}

double mean(double sum, std::int64_t count) {
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

}  // namespace

double ZoomReport::mean_vertices() const {
  return mean(static_cast<double>(vertices), readable_tiles);
}
double ZoomReport::mean_triangles() const {
  return mean(static_cast<double>(triangles), readable_tiles);
}
HausdorffDistances ZoomReport::mean_hausdorff() const {
  HausdorffDistances sum;
  for (const MeasuredTile& tile : measured) {
    sum.to_surfaces_m += tile.hausdorff.to_surfaces_m;
    sum.between_points_m += tile.hausdorff.between_points_m;
  }
  const std::int64_t count = std::ssize(measured);
  return {.to_surfaces_m = mean(sum.to_surfaces_m, count),
          .between_points_m = mean(sum.between_points_m, count)};
}

VerifyReport verify_set(const TileSet& tile_set, const VerifyOptions& options, Progress& progress) {
  QMPIPE_CHECK(options.threads >= 1 && options.most_per_kind >= 0);
  if (options.hausdorff == HausdorffMode::kMeasured && options.sources.empty()) {
    throw UsageError("--hausdorff measures tiles against their source: add --source INPUT");
  }
  return Verification(tile_set, options, progress).run();
}

}  // namespace qmpipe::verify
