#include "pipeline/survey/block_cover.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>
#include <string>

namespace qmpipe::testing::block_cover_test {
namespace {

RasterInfo somewhere(std::mt19937& dice) {
  const auto between = [&dice](double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(dice);
  };
  RasterInfo info;
  info.bounds_deg.west_deg = between(-180, 180);
  info.bounds_deg.east_deg = info.bounds_deg.west_deg + std::pow(10, between(-3, 2.5));
  info.bounds_deg.south_deg = between(-90, 89);
  info.bounds_deg.north_deg =
      std::min(90.0, info.bounds_deg.south_deg + std::pow(10, between(-3, 2)));
  return info;
}

// One after the other, each column brought onto the globe by itself.
std::vector<BlockKey> listed_blocks(const TilingScheme& scheme, std::int32_t zoom,
                                    const std::vector<RasterInfo>& sources) {
  const std::int32_t columns = scheme.columns(zoom);
  std::set<BlockKey> blocks;
  for (const RasterInfo& source : sources) {
    const BlockSpan span = covered_span(Lattice(scheme, zoom), source);
    for (std::int32_t y = span.first_y; y < span.first_y + span.height; ++y) {
      for (std::int32_t x = span.first_x; x < span.first_x + span.width; ++x) {
        blocks.insert({.zoom = zoom, .x = (x % columns + columns) % columns, .y = y});
      }
    }
  }
  return {blocks.begin(), blocks.end()};
}

TEST(ExpectedBlocks, CountsEveryBlockOnceHoweverManySourcesTouchIt) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 dice(seed);
  for (int turn = 0; turn < 200; ++turn) {
    const TilingScheme scheme(turn % 2 == 0 ? Projection::kGeodetic : Projection::kMercator);
    const auto zoom = static_cast<std::int32_t>(dice() % 8);
    std::vector<RasterInfo> sources(1 + dice() % 20);
    for (RasterInfo& info : sources) info = somewhere(dice);
    sources.push_back(sources.front());
    const std::vector<BlockKey> listed = listed_blocks(scheme, zoom, sources);
    SCOPED_TRACE("turn " + std::to_string(turn) + ", zoom " + std::to_string(zoom));
    EXPECT_EQ(covered_blocks(scheme, zoom, sources), listed);
    EXPECT_EQ(expected_blocks(scheme, zoom, sources), static_cast<std::int64_t>(listed.size()));
  }
}

TEST(ExpectedBlocks, OfManySmallSourcesAreNoMoreThanThoseOfOneLargeOne) {
  const TilingScheme scheme(Projection::kGeodetic);
  RasterInfo whole;
  whole.bounds_deg = {.west_deg = 6, .south_deg = 44, .east_deg = 8, .north_deg = 46};
  std::vector<RasterInfo> parts;
  for (int k = 0; k < 400; ++k) {
    RasterInfo part;
    part.bounds_deg.west_deg = 6 + 0.1 * (k % 20);
    part.bounds_deg.east_deg = part.bounds_deg.west_deg + 0.1;
    part.bounds_deg.south_deg = 44 + 0.1 * (k / 20);
    part.bounds_deg.north_deg = part.bounds_deg.south_deg + 0.1;
    parts.push_back(part);
  }
  for (std::int32_t zoom = 0; zoom <= 13; ++zoom) {
    EXPECT_EQ(expected_blocks(scheme, zoom, parts), expected_blocks(scheme, zoom, {whole})) << zoom;
  }
}

}  // namespace
}  // namespace qmpipe::testing::block_cover_test
