#include "pipeline/estimate.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <numeric>
#include <thread>

#include "pipeline/tile_builder.h"

namespace qmpipe {
namespace {

struct Cost {
  std::int64_t bytes = 0;
  double seconds = 0;
};

Cost cost_of(const TileKey& key, const TileBuilder& builder, GzipCompressor* compressor) {
  TileWork work;
  work.key = key;
  builder.read_window(work);
  builder.simplify(work, {}, {.key = key});
  builder.finish(work);
  builder.encode_bytes(work, compressor);
  return {.bytes = static_cast<std::int64_t>(work.bytes.size()),
          .seconds = std::accumulate(work.seconds.begin(), work.seconds.end(), 0.0)};
}

}  // namespace

Estimate estimate_build(const BuildOptions& options, const BuildPlan& plan,
                        const Heightfield& heightfield, const MemoryPlan& memory,
                        std::int32_t sample_tiles) {
  const TileBuilder builder(heightfield, plan.recipe);
  std::optional<GzipCompressor> compressor;
  if (options.encode.gzip_level) compressor.emplace(*options.encode.gzip_level);
  Estimate estimate;
  estimate.expected_peak_bytes = memory.expected_peak_bytes;
  estimate.sampling_zoom = plan.recipe.sampling_zoom;
  double core_s = 0;
  for (const auto& keys : plan.keys) {
    if (keys.empty()) continue;
    const auto samples = std::min<std::size_t>(keys.size(), static_cast<std::size_t>(sample_tiles));
    Cost sum;
    for (std::size_t k = 0; k < samples; ++k) {
      // The middle of each of `samples` equal parts of the list.
      const Cost cost = cost_of(keys[(2 * k + 1) * keys.size() / (2 * samples)], builder,
                                compressor ? &*compressor : nullptr);
      sum.bytes += cost.bytes;
      sum.seconds += cost.seconds;
    }
    const double scale = static_cast<double>(keys.size()) / static_cast<double>(samples);
    ZoomEstimate zoom{.zoom = keys.front().zoom,
                      .tiles = static_cast<std::int64_t>(keys.size()),
                      .bytes = static_cast<std::int64_t>(static_cast<double>(sum.bytes) * scale),
                      .seconds = sum.seconds * scale};
    estimate.tiles += zoom.tiles;
    estimate.bytes += zoom.bytes;
    core_s += zoom.seconds;
    estimate.zooms.push_back(zoom);
  }
  const auto cores = static_cast<std::int32_t>(std::max(1U, std::thread::hardware_concurrency()));
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
      "estimate: {} tiles, about {}, about {:.0f} s to mesh, at most {} of memory (sampled at zoom "
      "{})\n",
      estimate.tiles, bytes_text(estimate.bytes), std::max(1.0, estimate.seconds),
      bytes_text(estimate.expected_peak_bytes), estimate.sampling_zoom);
  return text;
}

std::string estimate_json(const Estimate& estimate) {
  nlohmann::ordered_json object = {{"event", "estimate"},
                                   {"tiles", estimate.tiles},
                                   {"bytes", estimate.bytes},
                                   {"mesh_s", estimate.seconds},
                                   {"expected_peak_bytes", estimate.expected_peak_bytes},
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
