#include "pipeline/verify/height_glance.h"

#include <algorithm>
#include <span>
#include <utility>
#include <vector>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe::verify {
namespace {

// Read at the first zoom, and kept of each zoom for being the highest, or the lowest.
constexpr std::size_t kMostAtFirst = 128;
constexpr std::size_t kKeptEachWay = 8;

struct Seen {
  TileKey key;
  HeightSpan heights;
  std::vector<TileKey> children;  // that are there
};

std::span<const TileKey> tiles_of_zoom(const std::vector<TileKey>& keys, std::int32_t zoom) {
  const auto [first, last] =
      std::equal_range(keys.begin(), keys.end(), TileKey{.zoom = zoom},
                       [](const TileKey& a, const TileKey& b) { return a.zoom < b.zoom; });
  return {first, last};
}

// The deepest zoom with few enough tiles, or the coarsest one, thinned out evenly.
std::vector<TileKey> first_tiles(const std::vector<TileKey>& keys) {
  std::span<const TileKey> tiles = tiles_of_zoom(keys, keys.front().zoom);
  for (std::int32_t zoom = keys.front().zoom; zoom <= keys.back().zoom; ++zoom) {
    const std::span<const TileKey> finer = tiles_of_zoom(keys, zoom);
    if (finer.size() > kMostAtFirst) break;
    if (!finer.empty()) tiles = finer;
  }
  const std::size_t step = (tiles.size() + kMostAtFirst - 1) / kMostAtFirst;
  std::vector<TileKey> chosen;
  for (std::size_t at = 0; at < tiles.size(); at += step) chosen.push_back(tiles[at]);
  return chosen;
}

std::vector<TileKey> children_there(const std::vector<TileKey>& keys, const TileKey& parent) {
  std::vector<TileKey> children;
  for (const std::int32_t k : {0, 1, 2, 3}) {
    const TileKey child = {
        .zoom = parent.zoom + 1, .x = 2 * parent.x + k % 2, .y = 2 * parent.y + k / 2};
    if (std::binary_search(keys.begin(), keys.end(), child)) children.push_back(child);
  }
  return children;
}

std::vector<Seen> look_at(const TileSet& tile_set, const std::vector<TileKey>& keys) {
  std::vector<Seen> seen;
  for (const TileKey& key : keys) {
    auto stored = tile_set.read(key);
    if (!stored) continue;
    const auto plain = plain_tile_bytes(std::move(*stored));
    if (!plain) continue;
    const auto mesh = decode(*plain);
    if (!mesh) continue;
    seen.push_back({.key = key,
                    .heights = {.low_m = static_cast<double>(mesh->header.min_height_m),
                                .high_m = static_cast<double>(mesh->header.max_height_m)},
                    .children = children_there(tile_set.keys(), key)});
  }
  return seen;
}

// The highest and the lowest, each once. Equal ones by their keys.
std::vector<Seen> outstanding(std::vector<Seen> seen) {
  std::vector<Seen> kept;
  const auto keep = [&](const auto& comes_first) {
    const std::size_t count = std::min(kKeptEachWay, seen.size());
    const auto end = seen.begin() + static_cast<std::ptrdiff_t>(count);
    std::partial_sort(seen.begin(), end, seen.end(), comes_first);
    kept.insert(kept.end(), seen.begin(), end);
    seen.erase(seen.begin(), end);
  };
  keep([](const Seen& a, const Seen& b) {
    return a.heights.high_m != b.heights.high_m ? a.heights.high_m > b.heights.high_m
                                                : a.key < b.key;
  });
  keep([](const Seen& a, const Seen& b) {
    return a.heights.low_m != b.heights.low_m ? a.heights.low_m < b.heights.low_m : a.key < b.key;
  });
  return kept;
}

}  // namespace

std::optional<HeightSpan> glance_at_heights(const TileSet& tile_set) {
  const std::vector<TileKey>& keys = tile_set.keys();
  if (keys.empty()) return std::nullopt;
  std::optional<HeightSpan> range;
  std::vector<Seen> seen = look_at(tile_set, first_tiles(keys));
  while (!seen.empty()) {
    std::vector<TileKey> next;
    std::vector<Seen> with_children;
    for (const Seen& tile : seen) {
      // A coarser zoom's heights are as far off as its tolerance allows: only what nothing replaces counts.
      if (tile.children.empty()) {
        include(range, tile.heights);
      } else {
        with_children.push_back(tile);
      }
    }
    for (const Seen& tile : outstanding(std::move(with_children))) {
      next.insert(next.end(), tile.children.begin(), tile.children.end());
    }
    seen = look_at(tile_set, next);
  }
  return range;
}

}  // namespace qmpipe::verify
