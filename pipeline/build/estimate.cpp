#include "pipeline/build/estimate.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "pipeline/build/tile_builder.h"
#include "pipeline/common/machine_share.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kTilesPerSample = 8;
// More of them would make a small set's estimate take as long as the set.
constexpr std::int64_t kFewest = 16;
constexpr std::int64_t kMost = 64;
// Of a tile that is flat, beside one whose range is the tolerance.
constexpr double kLeastWeight = 0.05;

struct Sample {
  TileKey key;
  double weight = 1;
  double times = 1;  // that it was drawn
  std::int64_t bytes = 0;
  double seconds = 0;
};

// The tiles of a zoom and what each is expected to weigh, relative to the others.
struct WeighedZoom {
  const std::vector<TileKey>* keys = nullptr;
  std::vector<double> weights = {};
  double sum = 0;
};

void measure(Sample& sample, const TileBuilder& builder, const std::optional<int>& gzip_level) {
  TileWork work;
  work.key = sample.key;
  builder.read_window(work);
  PlannedTile alone;
  alone.key = sample.key;
  builder.simplify(work, {}, alone);
  builder.finish(work);
  std::optional<GzipCompressor> compressor;
  if (gzip_level) compressor.emplace(*gzip_level);
  builder.encode_bytes(work, compressor ? &*compressor : nullptr);
  sample.bytes = static_cast<std::int64_t>(work.bytes.size());
  sample.seconds = std::accumulate(work.seconds.begin(), work.seconds.end(), 0.0);
}

// A tile's vertices, and with them bytes and time, grow about with the root of its range in tolerances,
// and a bit less than its valid posts, since what fills the rest is not free either.
double weight_of(const SurveyedTile& tile, double tolerance_m) {
  const double range =
      (static_cast<double>(tile.highest_m) - static_cast<double>(tile.lowest_m)) / tolerance_m;
  const double valid = tile.valid_posts / static_cast<double>(kTilePostCount);
  return kLeastWeight + std::sqrt(valid * range * std::sqrt(valid));
}

WeighedZoom weighed(const BuildOptions& options, const Survey& survey, const BuildPlan& plan,
                    std::size_t zoom) {
  WeighedZoom weighed{.keys = &plan.keys[zoom]};
  // How many vertices the other methods take is for their parameters to say.
  const bool by_relief = has_error_bound(options.mesh.method, options.mesh.stop);
  auto tile = survey.tiles[zoom].begin();
  for (const TileKey& key : *weighed.keys) {
    // Both lists are sorted; parents and roots without data are in the plan alone.
    while (tile != survey.tiles[zoom].end() && tile->key < key) ++tile;
    const bool has_data = tile != survey.tiles[zoom].end() && tile->key == key;
    weighed.weights.push_back(!by_relief ? 1
                              : has_data ? weight_of(*tile, plan.recipe.tolerance_m[zoom])
                                         : kLeastWeight);
    weighed.sum += weighed.weights.back();
  }
  return weighed;
}

// The tiles that stand at `count` places, evenly spaced, when each takes as much room as it weighs.
void choose_samples(const WeighedZoom& zoom, std::size_t count, std::vector<Sample>& samples) {
  double passed = 0;
  std::size_t chosen = 0;
  for (std::size_t k = 0; k < zoom.weights.size(); ++k) {
    passed += zoom.weights[k];
    const bool is_last = k + 1 == zoom.weights.size();
    const std::size_t before = chosen;
    while (chosen < count && (is_last || (static_cast<double>(chosen) + 0.5) * zoom.sum <
                                             passed * static_cast<double>(count))) {
      ++chosen;
    }
    if (chosen == before) continue;
    samples.push_back({.key = (*zoom.keys)[k],
                       .weight = zoom.weights[k],
                       .times = static_cast<double>(chosen - before)});
  }
}

std::vector<Sample> choose_samples(const std::vector<WeighedZoom>& zooms) {
  double sum = 0;
  std::int64_t tiles = 0;
  for (const WeighedZoom& zoom : zooms) {
    sum += zoom.sum;
    tiles += std::ssize(zoom.weights);
  }
  std::vector<Sample> samples;
  for (const WeighedZoom& zoom : zooms) {
    const double share = static_cast<double>(sampled_tiles(tiles)) * zoom.sum / sum;
    const auto count = static_cast<std::size_t>(std::max(1LL, std::llround(share)));
    if (count < zoom.weights.size()) {
      choose_samples(zoom, count, samples);
      continue;
    }
    // All of them, which then count alike: nothing is left to chance.
    const double weight = zoom.sum / static_cast<double>(zoom.weights.size());
    for (const TileKey& key : *zoom.keys) samples.push_back({.key = key, .weight = weight});
  }
  return samples;
}

ZoomEstimate scaled_up(const WeighedZoom& zoom, const std::vector<Sample>& samples) {
  ZoomEstimate estimate{.zoom = zoom.keys->front().zoom, .tiles = std::ssize(*zoom.keys)};
  double bytes = 0;
  double seconds = 0;
  double count = 0;
  for (const Sample& sample : samples) {
    if (sample.key.zoom != estimate.zoom) continue;
    bytes += sample.times * static_cast<double>(sample.bytes) / sample.weight;
    seconds += sample.times * sample.seconds / sample.weight;
    count += sample.times;
  }
  estimate.bytes = static_cast<std::int64_t>(bytes / count * zoom.sum);
  estimate.seconds = seconds / count * zoom.sum;
  return estimate;
}

}  // namespace

std::int64_t sampled_tiles(std::int64_t tiles) {
  return std::clamp(tiles / kTilesPerSample, kFewest, kMost);
}

Estimate estimate_build(const BuildOptions& options, const Survey& survey, const BuildPlan& plan,
                        const Heightfield& heightfield, const MemoryPlan& memory,
                        Progress& progress) {
  const TileBuilder builder(heightfield, plan.recipe);
  std::vector<WeighedZoom> zooms;
  for (std::size_t zoom = 0; zoom < plan.keys.size(); ++zoom) {
    if (!plan.keys[zoom].empty()) zooms.push_back(weighed(options, survey, plan, zoom));
  }
  std::vector<Sample> samples = choose_samples(zooms);
  {
    const Phase phase(progress, "estimate", "tiles", std::ssize(samples));
    tbb::task_arena arena(std::min(options.run.threads, memory.max_in_flight));
    arena.execute([&] {
      tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t k) {
        progress.check_stop();
        measure(samples[k], builder, options.encode.gzip_level);
        progress.advance(1);
      });
    });
  }
  Estimate estimate;
  estimate.expected_peak_bytes = memory.expected_peak_bytes;
  estimate.sampling_zoom = plan.recipe.sampling_zoom;
  double core_s = 0;
  for (const WeighedZoom& weighed_zoom : zooms) {
    const ZoomEstimate zoom = scaled_up(weighed_zoom, samples);
    estimate.tiles += zoom.tiles;
    estimate.bytes += zoom.bytes;
    core_s += zoom.seconds;
    estimate.zooms.push_back(zoom);
  }
  const auto cores = usable_threads();
  estimate.seconds = core_s / std::min(cores, options.run.threads);
  return estimate;
}

std::string bytes_text(std::int64_t bytes) {
  constexpr std::array<const char*, 5> kUnits = {"bytes", "kB", "MB", "GB", "TB"};
  auto value = static_cast<double>(bytes);
  std::size_t unit = 0;
  while (value >= 1000 && unit + 1 < kUnits.size()) {
    value /= 1000;
    ++unit;
  }
  return unit == 0 ? fmt::format("{} bytes", bytes) : fmt::format("{:.1f} {}", value, kUnits[unit]);
}

std::string estimate_text(const Estimate& estimate) {
  std::string text =
      fmt::format("{:>4} {:>10} {:>12} {:>14}\n", "zoom", "tiles", "size", "core seconds");
  for (const ZoomEstimate& zoom : estimate.zooms) {
    text += fmt::format("{:>4} {:>10} {:>12} {:>14.1f}\n", zoom.zoom, zoom.tiles,
                        bytes_text(zoom.bytes), zoom.seconds);
  }
  text += fmt::format(
      "estimate: {} tiles, about {}, about {:.0f} s to mesh, at most {} of memory and {} of disk "
      "for "
      "the lattice (sampled at zoom {})\n",
      estimate.tiles, bytes_text(estimate.bytes), std::max(1.0, estimate.seconds),
      bytes_text(estimate.expected_peak_bytes), bytes_text(estimate.store_bytes),
      estimate.sampling_zoom);
  return text;
}

std::string estimate_json(const Estimate& estimate) {
  nlohmann::ordered_json object = {{"event", "estimate"},
                                   {"tiles", estimate.tiles},
                                   {"bytes", estimate.bytes},
                                   {"mesh_s", estimate.seconds},
                                   {"expected_peak_bytes", estimate.expected_peak_bytes},
                                   {"store_bytes", estimate.store_bytes},
                                   {"sampling_zoom", estimate.sampling_zoom}};
  for (const ZoomEstimate& zoom : estimate.zooms) {
    object["zooms"].push_back({{"zoom", zoom.zoom},
                               {"tiles", zoom.tiles},
                               {"bytes", zoom.bytes},
                               {"core_s", zoom.seconds}});
  }
  return object.dump();
}

}  // namespace qmpipe
