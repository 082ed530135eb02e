#include "pipeline/web_check/check_sample.h"

#include <algorithm>
#include <random>

namespace qmpipe::web_check {
namespace {

constexpr std::uint64_t kSeed = 20;
// Random tries for each tile wanted; small sets run out of new tiles.
constexpr std::size_t kTriesPerTile = 8;

std::int64_t area(const TileRange& range) {
  return (std::int64_t{range.end_x} - range.start_x + 1) *
         (std::int64_t{range.end_y} - range.start_y + 1);
}

bool contains(const std::vector<TileKey>& keys, const TileKey& key) {
  return std::find(keys.begin(), keys.end(), key) != keys.end();
}

// In [first, last]; the same on every machine, which the standard's distributions are not.
std::int32_t random_between(std::mt19937_64& random, std::int32_t first, std::int32_t last) {
  const auto count = static_cast<std::uint64_t>(std::int64_t{last} - first + 1);
  return static_cast<std::int32_t>(first + static_cast<std::int64_t>(random() % count));
}

}  // namespace

std::vector<TileKey> telling_tiles(const std::vector<TileRange>& ranges, std::int32_t zoom) {
  std::vector<TileKey> keys;
  if (ranges.empty()) return keys;
  const auto add = [&](std::int32_t x, std::int32_t y) {
    const TileKey key = {.zoom = zoom, .x = x, .y = y};
    if (!contains(keys, key)) keys.push_back(key);
  };
  const TileRange& largest =
      *std::max_element(ranges.begin(), ranges.end(),
                        [](const TileRange& a, const TileRange& b) { return area(a) < area(b); });
  add(largest.start_x + (largest.end_x - largest.start_x) / 2,
      largest.start_y + (largest.end_y - largest.start_y) / 2);
  const auto extreme = [&](auto corner_of, auto rank) {
    const TileRange& range = *std::min_element(
        ranges.begin(), ranges.end(),
        [&](const TileRange& a, const TileRange& b) { return rank(a) < rank(b); });
    corner_of(range);
  };
  extreme([&](const TileRange& r) { add(r.start_x, r.start_y); },
          [](const TileRange& r) { return std::int64_t{r.start_x} + r.start_y; });
  extreme([&](const TileRange& r) { add(r.end_x, r.end_y); },
          [](const TileRange& r) { return -std::int64_t{r.end_x} - r.end_y; });
  extreme([&](const TileRange& r) { add(r.start_x, r.end_y); },
          [](const TileRange& r) { return std::int64_t{r.start_x} - r.end_y; });
  extreme([&](const TileRange& r) { add(r.end_x, r.start_y); },
          [](const TileRange& r) { return std::int64_t{r.start_y} - r.end_x; });
  return keys;
}

std::vector<TileKey> sample_tiles(const std::vector<std::vector<TileRange>>& available,
                                  const std::vector<TileKey>& roots, std::size_t limit) {
  std::vector<TileKey> keys;
  const auto add = [&](const TileKey& key) {
    if (keys.size() < limit && !contains(keys, key)) keys.push_back(key);
  };
  for (const TileKey& root : roots) add(root);
  std::vector<std::vector<TileKey>> telling;
  std::vector<std::int32_t> zooms;
  for (std::size_t zoom = 0; zoom < available.size(); ++zoom) {
    telling.push_back(telling_tiles(available[zoom], static_cast<std::int32_t>(zoom)));
    if (!available[zoom].empty()) zooms.push_back(static_cast<std::int32_t>(zoom));
  }
  for (std::size_t rank = 0; rank < 5; ++rank) {
    for (const std::vector<TileKey>& of_zoom : telling) {
      if (rank < of_zoom.size()) add(of_zoom[rank]);
    }
  }
  std::mt19937_64 random(kSeed);
  for (std::size_t tries = limit * kTriesPerTile;
       tries > 0 && keys.size() < limit && !zooms.empty(); --tries) {
    const auto last_zoom = static_cast<std::int32_t>(zooms.size()) - 1;
    const std::int32_t zoom = zooms[static_cast<std::size_t>(random_between(random, 0, last_zoom))];
    const std::vector<TileRange>& ranges = available[static_cast<std::size_t>(zoom)];
    const TileRange& range = ranges[static_cast<std::size_t>(
        random_between(random, 0, static_cast<std::int32_t>(ranges.size()) - 1))];
    const std::int32_t x = random_between(random, range.start_x, range.end_x);
    add({.zoom = zoom, .x = x, .y = random_between(random, range.start_y, range.end_y)});
  }
  std::sort(keys.begin(), keys.end());
  return keys;
}

}  // namespace qmpipe::web_check
