#include "pipeline/survey/memory_share.h"

#include <gtest/gtest.h>

#include <cstdint>
#include <random>
#include <string>

#include "formats/bytes/errors.h"

namespace qmpipe::memory_share_test {
namespace {

RasterInfo source_of_a_quarter() {
  RasterInfo source;
  source.bounds_deg = {.west_deg = -36, .south_deg = 15, .east_deg = 43, .north_deg = 90};
  source.pixel_deg = 0.01;
  source.blocks.width = 256;
  source.blocks.height = 256;
  return source;
}

TEST(MemoryShare, LessMemoryMovesTheDeepestZoomsToDiskFirst) {
  const RasterInfo source = source_of_a_quarter();
  const SurveyChoice choice;
  std::int32_t last_before = kMaxZoom;
  for (const std::int64_t mebibytes : {8192, 2048, 1024, 512, 300}) {
    const MemoryShare share =
        MemoryDivisions({.limit_bytes = mebibytes << 20U}, choice, {source}).best();
    EXPECT_LE(share.plan.expected_peak_bytes, mebibytes << 20U);
    EXPECT_LE(share.last_memory_zoom, last_before);
    last_before = share.last_memory_zoom;
  }
  EXPECT_LT(last_before, chosen_sampling_zoom(choice, {source}));
  EXPECT_THROW(MemoryDivisions({.limit_bytes = 50LL << 20U}, choice, {source}), UsageError);
}

TEST(MemoryShare, TheLatticeGivesWayToTheStripsOfAWideSource) {
  RasterInfo source;
  source.width = 57600;
  source.height = 2400;
  source.bounds_deg = {.west_deg = 0, .south_deg = 10, .east_deg = 80, .north_deg = 13.3333};
  source.pixel_deg = 80.0 / 57600;
  source.blocks.cached_width = source.width;
  source.blocks.cached_height = 1;
  source.blocks.cached_bytes = source.width * 2;
  const SurveyChoice choice{.threads = 2};
  const MemoryShare share = MemoryDivisions({.limit_bytes = 320LL << 20U}, choice, {source}).best();
  EXPECT_LT(share.last_memory_zoom, chosen_sampling_zoom(choice, {source}));
  EXPECT_GE(share.plan.source_cache_bytes, 260 * source.blocks.cached_bytes);
  EXPECT_LE(share.plan.expected_peak_bytes, 320LL << 20U);
}

// As when an earlier run, with less memory, has put zooms there already.
TEST(MemoryShare, ZoomsThatAreOnDiskStayThere) {
  const RasterInfo source = source_of_a_quarter();
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937_64 random(seed);
  for (int round = 0; round < 30; ++round) {
    const SurveyChoice choice{.threads = static_cast<std::int32_t>(1 + random() % 8)};
    const auto limit_bytes = static_cast<std::int64_t>(600 + random() % 8000) << 20U;
    const MemoryDivisions divisions({.limit_bytes = limit_bytes}, choice, {source});
    const MemoryShare free = divisions.best();
    const auto deepest = static_cast<std::int32_t>(random() % 12) - 1;
    const MemoryShare bound = divisions.best(deepest);
    EXPECT_LE(bound.last_memory_zoom, deepest);
    EXPECT_LE(bound.plan.expected_peak_bytes, limit_bytes);
    EXPECT_GE(bound.store_bytes, free.last_memory_zoom > deepest ? 1 : 0);
    EXPECT_EQ(divisions.best(free.last_memory_zoom).last_memory_zoom, free.last_memory_zoom);
  }
}

}  // namespace
}  // namespace qmpipe::memory_share_test
