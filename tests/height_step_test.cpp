#include "stages/height_step.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace qmpipe {
namespace {

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

bool is_power_of_two(double value) {
  int exponent = 0;
  return std::frexp(value, &exponent) == 0.5;
}

TEST(HeightStep, IsALargePowerOfTwoThatTheToleranceAndTheRangeAllow) {
  for (std::uint64_t seed = 1; seed <= 20000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double tolerance_m = std::exp2(uniform(random, -8, 17));
    const double range_m = seed % 5 == 0 ? 0 : std::exp2(uniform(random, -3, 15));
    const auto step_m = height_step_for(tolerance_m, range_m);
    if (!step_m) {
      // Truly impossible: the smallest step that holds the range is too coarse.
      ASSERT_GT(range_m, tolerance_m / 2 * 32766);
      continue;
    }
    ASSERT_TRUE(is_power_of_two(*step_m));
    // A range widened by snapping both of its ends still fits.
    ASSERT_LE(range_m + *step_m, *step_m * 32767);
    ASSERT_LE(*step_m, tolerance_m);
    const bool range_decides = range_m + *step_m / 2 > *step_m / 2 * 32767;
    if (!range_decides) {
      ASSERT_LE(*step_m, tolerance_m / 16);
      ASSERT_GT(*step_m, tolerance_m / 32);
    }
  }
}

TEST(HeightStep, IsNeverAboveASixteenthOfTheToleranceForRoundingsSake) {
  for (int k = -10; k <= 16; ++k) {
    const double power = std::exp2(k);
    EXPECT_EQ(*height_step_for(power, 0), power / 16);
    EXPECT_EQ(*height_step_for(std::nextafter(power, 0), 0), power / 32);
    EXPECT_EQ(*height_step_for(std::nextafter(power, 1e9), 0), power / 16);
  }
}

TEST(HeightStep, ARefusalNamesAToleranceThatWorks) {
  const auto refused = height_step_for(0.01, 9000);
  ASSERT_FALSE(refused.ok());
  EXPECT_NE(refused.error().message.find("9000.0 m"), std::string::npos);
  EXPECT_NE(refused.error().message.find("0.5 m or more"), std::string::npos)
      << refused.error().message;
  EXPECT_TRUE(height_step_for(0.5, 9000).ok());
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
}  // namespace qmpipe
