#include "pipeline/estimate.h"

#include <fmt/format.h>
#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <numeric>
#include <optional>

#include "pipeline/machine_share.h"
#include "pipeline/tile_builder.h"

namespace qmpipe {
namespace {

constexpr std::size_t kTilesPerSample = 50;
constexpr std::size_t kFewTiles = 10;
constexpr std::size_t kFewest = 2;
constexpr std::size_t kMost = 6;

struct Sample {
  TileKey key;
  std::int64_t bytes = 0;
  double seconds = 0;
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

// A few tiles of each zoom, more of a zoom that has many: each is the middle of one of equal parts of
// the zoom's list.
std::vector<Sample> choose_samples(const BuildPlan& plan) {
  std::vector<Sample> samples;
  for (const auto& keys : plan.keys) {
    if (keys.empty()) continue;
    // A method that takes a second for a tile would else estimate a small set as long as build it.
    const std::size_t count =
        keys.size() < kFewTiles ? 1 : std::clamp(keys.size() / kTilesPerSample, kFewest, kMost);
    for (std::size_t k = 0; k < count; ++k) {
      samples.push_back({.key = keys[(2 * k + 1) * keys.size() / (2 * count)]});
    }
  }
  return samples;
}

ZoomEstimate scaled_up(const std::vector<TileKey>& keys, const std::vector<Sample>& samples) {
  ZoomEstimate zoom{.zoom = keys.front().zoom, .tiles = static_cast<std::int64_t>(keys.size())};
  double bytes = 0;
  double count = 0;
  for (const Sample& sample : samples) {
    if (sample.key.zoom != zoom.zoom) continue;
    bytes += static_cast<double>(sample.bytes);
    zoom.seconds += sample.seconds;
    ++count;
  }
  const double scale = static_cast<double>(keys.size()) / count;
  zoom.bytes = static_cast<std::int64_t>(bytes * scale);
  zoom.seconds *= scale;
  return zoom;
}

}  // namespace

Estimate estimate_build(const BuildOptions& options, const BuildPlan& plan,
                        const Heightfield& heightfield, const MemoryPlan& memory) {
  const TileBuilder builder(heightfield, plan.recipe);
  std::vector<Sample> samples = choose_samples(plan);
  tbb::task_arena arena(std::min(options.run.threads, memory.max_in_flight));
  arena.execute([&] {
    tbb::parallel_for(std::size_t{0}, samples.size(), [&](std::size_t k) {
      measure(samples[k], builder, options.encode.gzip_level);
    });
  });
  Estimate estimate;
  estimate.expected_peak_bytes = memory.expected_peak_bytes;
  estimate.sampling_zoom = plan.recipe.sampling_zoom;
  double core_s = 0;
  for (const auto& keys : plan.keys) {
    if (keys.empty()) continue;
    const ZoomEstimate zoom = scaled_up(keys, samples);
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
