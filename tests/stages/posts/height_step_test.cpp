#include "stages/posts/height_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace qmpipe::height_step_test {
namespace {

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

// How many bits of a double's 53 are used.
int significant_bits(double value) {
  int exponent = 0;
  auto bits = static_cast<std::int64_t>(std::ldexp(std::frexp(value, &exponent), 53));
  int unused = 0;
  for (; bits % 2 == 0; bits /= 2) ++unused;
  return 53 - unused;
}

struct Zoom {
  double tolerance_m = 0;
  double range_m = 0;
  double reach_m = 0;
};

Zoom random_zoom(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Zoom zoom;
  zoom.tolerance_m = std::exp2(uniform(random, -11, 17));
  zoom.range_m = seed % 5 == 0 ? 0 : std::exp2(uniform(random, -3, 15));
  zoom.reach_m = std::max(zoom.range_m / 2, seed % 3 == 0 ? 0 : std::exp2(uniform(random, 0, 14)));
  return zoom;
}

TEST(HeightStep, HoldsTheRangeIsExactInFloatAndWithinTheTolerance) {
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 40000; ++seed) {
    const Zoom zoom = random_zoom(seed);
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ": " << zoom.tolerance_m << " "
                                      << zoom.range_m << " " << zoom.reach_m);
    const auto step_m = height_step_for(zoom.tolerance_m, zoom.range_m, zoom.reach_m);
    const double least_m = least_tolerance_m(zoom.range_m, zoom.reach_m);
    if (!step_m) {
      ++refused;
      // Truly impossible: the format's heights, or float32's, are too far apart.
      const double float_m = std::exp2(std::floor(std::log2(zoom.reach_m)) - 23);
      // (Where a step may have one bit only, to a factor of two.)
      ASSERT_GT(2 * std::max(zoom.range_m / 32766, float_m), zoom.tolerance_m);
      ASSERT_GT(least_m, zoom.tolerance_m);
      ASSERT_TRUE(height_step_for(least_m, zoom.range_m, zoom.reach_m).ok());
      continue;
    }
    // A range widened by snapping both of its ends still fits.
    ASSERT_LE(zoom.range_m + *step_m, *step_m * 32767);
    ASSERT_LE(*step_m, zoom.tolerance_m);
    ASSERT_LE(significant_bits(*step_m), 8);
    for (const double height_m : {zoom.reach_m, -zoom.reach_m, zoom.reach_m / 3}) {
      const double multiple_m = snapped_height(height_m, *step_m);
      ASSERT_EQ(static_cast<double>(static_cast<float>(multiple_m)), multiple_m);
    }
    if (zoom.range_m < zoom.tolerance_m && zoom.reach_m < 1000 * zoom.tolerance_m) {
      ASSERT_LE(*step_m, zoom.tolerance_m / 16);
      ASSERT_GT(*step_m, zoom.tolerance_m / 16.2);
    }
  }
  EXPECT_GT(refused, 100);
}

// The largest range that a header may have beside that of the tile: 15 %, where the tolerance is not
// so small that 32,768 heights hardly hold it.
TEST(HeightStep, LeavesNoMoreThanAFewHeightsUnused) {
  int judged = 0;
  for (std::uint64_t seed = 1; seed <= 40000; ++seed) {
    const Zoom zoom = random_zoom(seed);
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto step_m = height_step_for(zoom.tolerance_m, zoom.range_m, zoom.reach_m);
    if (!step_m) continue;
    std::mt19937_64 random(seed);
    const double range_m = zoom.range_m * uniform(random, 0, 1);
    const HeightSteps steps = tile_steps(*step_m, zoom.tolerance_m, range_m);
    ASSERT_EQ(steps.side_m, *step_m);
    ASSERT_EQ(steps.inner_m, *step_m / steps.parts);
    // Snapped ends, and a minimum on a step of the sides.
    const double inner = (std::ceil(range_m / steps.side_m) + 1) * steps.parts;
    ASSERT_LE(inner, 32767);
    if (range_m > zoom.tolerance_m * 1500 || range_m < 100 * steps.side_m) continue;
    ++judged;
    const double units = std::floor(32767 / inner);
    ASSERT_LE(32767 / (units * range_m / steps.inner_m), 1.15);
  }
  EXPECT_GT(judged, 3000);
}

TEST(HeightStep, ARefusalNamesAToleranceThatWorks) {
  const auto refused = height_step_for(0.01, 9000, 9000);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("9000.0 m"), std::string::npos);
  EXPECT_NE(refused.error().message.find("0.276 m or more"), std::string::npos)
      << refused.error().message;
  EXPECT_TRUE(height_step_for(0.276, 9000, 9000).ok());
}

TEST(SnappedHeight, IsTheNearestMultipleWithHalvesAwayFromZero) {
  EXPECT_EQ(snapped_height(0.5, 1), 1);
  EXPECT_EQ(snapped_height(-0.5, 1), -1);
  EXPECT_EQ(snapped_height(2.5, 1), 3);
  EXPECT_EQ(snapped_height(7, 4), 8);
  for (std::uint64_t seed = 1; seed <= 5000; ++seed) {
    std::mt19937_64 random(seed);
    const double step_m = std::exp2(static_cast<double>(random() % 12) - 6);
    const double height_m = uniform(random, -11000, 9000);
    const double snapped_m = snapped_height(height_m, step_m);
    ASSERT_EQ(std::fmod(snapped_m, step_m), 0);
    ASSERT_LE(std::abs(snapped_m - height_m), step_m / 2);
  }
}

}  // namespace
}  // namespace qmpipe::height_step_test
