#include "pipeline/survey/sampling_order.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <set>

#include "formats/run_store/lattice_store.h"

namespace qmpipe::sampling_order_test {
namespace {

constexpr std::int64_t kMiB = 1 << 20;

// EMODnet's grid of 2018, int16.
RasterInfo large_grid(std::int64_t block_width, std::int64_t block_height) {
  RasterInfo info;
  info.width = 113892;
  info.height = 108132;
  info.bounds_deg = {.west_deg = -36, .south_deg = 15, .east_deg = 43, .north_deg = 90};
  info.pixel_deg = 75.0 / 108132;
  info.blocks.cached_width = block_width;
  info.blocks.cached_height = block_height;
  info.blocks.cached_bytes = block_width * block_height * 2;
  return info;
}

Lattice lattice_for(std::int32_t zoom) { return {TilingScheme(Projection::kGeodetic), zoom}; }

std::int32_t whole(const Lattice& lattice) { return lattice.scheme().columns(lattice.zoom()); }

TEST(SamplingOrder, AFrontOfStripsIsTwiceTheRowsOfABlock) {
  const Lattice lattice = lattice_for(10);
  const RasterInfo strips = large_grid(113892, 1);
  const std::int64_t bytes = front_bytes(lattice, {strips}, 2, whole(lattice));
  EXPECT_GT(bytes, 2 * 253 * strips.blocks.cached_bytes);
  EXPECT_LT(bytes, 2 * 262 * strips.blocks.cached_bytes);
}

TEST(SamplingOrder, NoFrontIsLargerThanTheSource) {
  const Lattice lattice = lattice_for(10);
  const RasterInfo one_block = large_grid(113892, 108132);
  EXPECT_EQ(front_bytes(lattice, {one_block}, 80, whole(lattice)), one_block.blocks.cached_bytes);
}

TEST(SamplingOrder, SourcesSideBySideInARowAddUp) {
  const Lattice lattice = lattice_for(10);
  RasterInfo west = large_grid(256, 256);
  west.width /= 2;
  west.bounds_deg.east_deg = 3.5;
  RasterInfo east = west;
  east.bounds_deg = {.west_deg = 3.5, .south_deg = 15, .east_deg = 43, .north_deg = 90};
  RasterInfo elsewhere = west;
  elsewhere.bounds_deg = {.west_deg = -36, .south_deg = -80, .east_deg = 3.5, .north_deg = 0};
  const std::int64_t one = front_bytes(lattice, {west}, 2, whole(lattice));
  EXPECT_EQ(front_bytes(lattice, {west, east}, 2, whole(lattice)), 2 * one);
  EXPECT_EQ(front_bytes(lattice, {west, elsewhere}, 2, whole(lattice)), one);
}

TEST(SamplingOrder, StripsAreAsWideAsTheCacheAllows) {
  const Lattice lattice = lattice_for(10);
  const std::vector<RasterInfo> tiles = {large_grid(256, 256)};
  std::int32_t narrower = whole(lattice);
  for (const std::int64_t cache_bytes : {512 * kMiB, 64 * kMiB, 16 * kMiB, 8 * kMiB}) {
    const std::int32_t strip = widest_strip(lattice, tiles, 2, cache_bytes);
    EXPECT_LE(front_bytes(lattice, tiles, 2, strip), cache_bytes);
    EXPECT_LE(strip, narrower);
    narrower = strip;
    if (strip == whole(lattice)) continue;
    EXPECT_GT(front_bytes(lattice, tiles, 2, 2 * strip), cache_bytes);
  }
  EXPECT_LT(narrower, 64);
  EXPECT_EQ(widest_strip(lattice, tiles, 2, 512 * kMiB), whole(lattice));
}

TEST(SamplingOrder, NarrowStripsAreNoHelpForStripedFiles) {
  const Lattice lattice = lattice_for(10);
  EXPECT_EQ(widest_strip(lattice, {large_grid(113892, 1)}, 2, kMiB), whole(lattice));
}

TEST(SamplingOrder, SourcesAcrossTheAntimeridianAreSeen) {
  const Lattice lattice = lattice_for(5);
  RasterInfo info = large_grid(256, 256);
  info.bounds_deg = {.west_deg = 170, .south_deg = -10, .east_deg = 190, .north_deg = 10};
  for (std::int32_t strip = whole(lattice); strip >= 1; strip /= 2) {
    EXPECT_GT(front_bytes(lattice, {info}, 2, strip), 0);
  }
}

TEST(SamplingOrder, EveryBlockOnceStripByStripFromTheNorth) {
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    std::set<TileKey> chosen;
    for (int k = 0; k < 200; ++k) {
      chosen.insert({.zoom = 6,
                     .x = static_cast<std::int32_t>(random() % 128),
                     .y = static_cast<std::int32_t>(random() % 65)});
    }
    const auto strip = static_cast<std::int32_t>(1ULL << random() % 8);
    std::vector<TileKey> blocks(chosen.begin(), chosen.end());
    std::shuffle(blocks.begin(), blocks.end(), random);
    sort_for_sampling(blocks, strip);
    EXPECT_EQ(std::set<TileKey>(blocks.begin(), blocks.end()), chosen);
    ASSERT_EQ(blocks.size(), chosen.size());
    for (std::size_t k = 1; k < blocks.size(); ++k) {
      const TileKey& a = blocks[k - 1];
      const TileKey& b = blocks[k];
      ASSERT_LE(a.x / strip, b.x / strip);
      if (a.x / strip < b.x / strip) continue;
      ASSERT_GE(a.y, b.y);
      if (a.y == b.y) {
        ASSERT_LT(a.x, b.x);
      }
    }
  }
}

}  // namespace
}  // namespace qmpipe::sampling_order_test
