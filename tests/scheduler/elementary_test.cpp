#include "scheduler/elementary.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numbers>
#include <random>

namespace qmpipe::elementary_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();
constexpr long double kDegPerRad = 180 / std::numbers::pi_v<long double>;

// The distance in units of the last place that the exact value has as a double.
double ulps(double value, long double exact) {
  const int exponent = exact == 0 ? -1074 : std::ilogb(static_cast<double>(exact)) - 52;
  return std::abs(static_cast<double>(
      std::scalbn(static_cast<long double>(value) - exact, -std::max(exponent, -1074))));
}

class Draw {
 public:
  explicit Draw(std::uint64_t seed) : random_(seed) {}
  // Every magnitude from 2^low to 2^high alike, either sign.
  double spread(int low, int high) {
    const double size = std::ldexp(
        1 + part(), low + static_cast<int>(random_() % static_cast<unsigned>(high - low)));
    return random_() % 2 == 0 ? size : -size;
  }
  double between(double low, double high) { return low + (high - low) * part(); }

 private:
  double part() { return static_cast<double>(random_() >> 11U) * 0x1p-53; }
  std::mt19937_64 random_;
};

constexpr int kTrials = 100'000;

// long double has 11 bits more than double here; where it has not, there is nothing to measure by.
class Elementary : public ::testing::Test {
 protected:
  void SetUp() override {
    if constexpr (std::numeric_limits<long double>::digits < 64) {
      GTEST_SKIP() << "long double is no better than double on this machine";
    }
  }
};

TEST_F(Elementary, SinesAndCosinesAreWithinTwoUlp) {
  Draw draw(1);
  double worst_sin = 0;
  double worst_cos = 0;
  for (int k = 0; k < kTrials; ++k) {
    const double angle = k % 4 == 0 ? draw.spread(-60, 9) : draw.between(-400, 400);
    // Reduced exactly, or long double would lose what it has more than double.
    const long double quarters = std::nearbyint(static_cast<long double>(angle) / 90);
    const long double left = (static_cast<long double>(angle) - 90 * quarters) / kDegPerRad;
    const bool is_odd = std::abs(std::fmod(quarters, 2.0L)) == 1;
    const SinCos got = sin_cos_deg(angle);
    const long double exact_sin = is_odd ? std::cos(left) : std::sin(left);
    const long double exact_cos = is_odd ? std::sin(left) : std::cos(left);
    worst_sin = std::max(worst_sin, ulps(std::abs(got.sin), std::abs(exact_sin)));
    worst_cos = std::max(worst_cos, ulps(std::abs(got.cos), std::abs(exact_cos)));
  }
  EXPECT_LE(worst_sin, 2) << "seed 1";
  EXPECT_LE(worst_cos, 2) << "seed 1";
}

TEST_F(Elementary, ArcTangentsAreWithinThreeUlp) {
  Draw draw(2);
  double worst = 0;
  for (int k = 0; k < kTrials; ++k) {
    const bool is_wild = k % 4 == 0;
    const double y = is_wild ? draw.spread(-1000, 1000) : draw.between(-7e6, 7e6);
    const double x = is_wild ? draw.spread(-1000, 1000) : draw.between(-7e6, 7e6);
    const long double exact =
        std::atan2(static_cast<long double>(y), static_cast<long double>(x)) * kDegPerRad;
    // Below what a double holds with all digits.
    if (std::abs(exact) < 1e-300L) continue;
    worst = std::max(worst, ulps(atan2_deg(y, x), exact));
  }
  EXPECT_LE(worst, 3) << "seed 2";
}

TEST_F(Elementary, ExponentialsAndLogarithmsAreWithinOneAndAHalfUlp) {
  Draw draw(3);
  double worst_exponential = 0;
  double worst_logarithm = 0;
  for (int k = 0; k < kTrials; ++k) {
    const double x = k % 4 == 0 ? draw.spread(-60, 9) : draw.between(-40, 5);
    worst_exponential =
        std::max(worst_exponential, ulps(exponential(x), std::exp(static_cast<long double>(x))));
    const double y = k % 4 == 0 ? std::abs(draw.spread(-1070, 1023)) : draw.between(0.3, 3);
    worst_logarithm =
        std::max(worst_logarithm, ulps(logarithm(y), std::log(static_cast<long double>(y))));
  }
  EXPECT_LE(worst_exponential, 1.5) << "seed 3";
  EXPECT_LE(worst_logarithm, 1.5) << "seed 3";
}

TEST_F(Elementary, TheOthersKeepWhatTheyPromise) {
  Draw draw(4);
  double worst_sinh = 0;
  double worst_decimal = 0;
  for (int k = 0; k < kTrials; ++k) {
    const double x = k % 2 == 0 ? draw.spread(-40, 4) : draw.between(-4, 4);
    worst_sinh =
        std::max(worst_sinh, ulps(hyperbolic_sine(x), std::sinh(static_cast<long double>(x))));
    const double y = draw.between(0.001, 1e6);
    worst_decimal = std::max(worst_decimal,
                             ulps(decimal_logarithm(y), std::log10(static_cast<long double>(y))));
    const double exponent = draw.between(-3, 3);
    const long double exact =
        std::pow(static_cast<long double>(y), static_cast<long double>(exponent));
    ASSERT_LE(ulps(power(y, exponent), exact), 2 + 2 * std::abs(exponent * std::log(y)))
        << y << " to the power of " << exponent << ", seed 4";
  }
  EXPECT_LE(worst_sinh, 2.5) << "seed 4";
  EXPECT_LE(worst_decimal, 2.5) << "seed 4";
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

TEST(ElementaryValues, PolesAndTheAntimeridianAreExact) {
  for (int turns = -3; turns <= 3; ++turns) {
    const double turn = 360.0 * turns;
    EXPECT_TRUE(same_bits(sin_deg(turn), 0) && same_bits(cos_deg(turn), 1));
    EXPECT_TRUE(same_bits(sin_deg(turn + 90), 1) && same_bits(cos_deg(turn + 90), 0));
    EXPECT_TRUE(same_bits(sin_deg(turn + 180), 0) && same_bits(cos_deg(turn + 180), -1));
    EXPECT_TRUE(same_bits(sin_deg(turn - 90), -1) && same_bits(cos_deg(turn - 90), 0));
  }
  EXPECT_EQ(atan2_deg(0, 1), 0);
  EXPECT_EQ(atan2_deg(5, 5), 45);
  EXPECT_EQ(atan2_deg(2, 0), 90);
  EXPECT_EQ(atan2_deg(0, -3), 180);
  EXPECT_EQ(atan2_deg(-0.0, -3), -180);
  EXPECT_EQ(atan2_deg(-2, 0), -90);
  EXPECT_TRUE(same_bits(atan2_deg(-0.0, 0), -0.0));
  EXPECT_EQ(atan2_deg(kInfinity, 1), 90);
  EXPECT_EQ(atan2_deg(-kInfinity, -kInfinity), -135);
  EXPECT_TRUE(std::isnan(atan2_deg(std::nan(""), 1)));
}

TEST(ElementaryValues, EveryQuarterHasItsSigns) {
  Draw draw(6);
  for (int k = 0; k < 20'000; ++k) {
    const double angle = draw.between(-1000, 1000);
    const double radians = angle * std::numbers::pi / 180;
    ASSERT_NEAR(sin_deg(angle), std::sin(radians), 1e-14) << angle << ", seed 6";
    ASSERT_NEAR(cos_deg(angle), std::cos(radians), 1e-14) << angle << ", seed 6";
  }
}

TEST(ElementaryValues, SinesAreOddAndCosinesEven) {
  Draw draw(5);
  for (int k = 0; k < 20'000; ++k) {
    const double angle = draw.between(0.001, 179.999);
    ASSERT_TRUE(same_bits(sin_deg(-angle), -sin_deg(angle))) << angle << ", seed 5";
    ASSERT_TRUE(same_bits(cos_deg(-angle), cos_deg(angle))) << angle << ", seed 5";
    ASSERT_TRUE(same_bits(hyperbolic_sine(-angle), -hyperbolic_sine(angle))) << angle;
  }
}

TEST(ElementaryValues, WholePowersAndTheirLogarithmsAreExact) {
  double ten = 1;
  for (int n = 0; n <= 22; ++n, ten *= 10) {
    EXPECT_EQ(whole_power(10, n), ten);
    EXPECT_EQ(whole_power(10, -n), 1 / ten);
    EXPECT_EQ(decimal_logarithm(ten), n);
    EXPECT_EQ(decimal_logarithm(1 / ten), -n);
  }
  EXPECT_EQ(whole_power(0.5, 24), 0x1p-24);
  EXPECT_EQ(logarithm(1), 0);
  EXPECT_EQ(exponential(0), 1);
}

TEST(ElementaryValues, ExponentialsEndAtWhatADoubleHolds) {
  EXPECT_EQ(exponential(800), kInfinity);
  EXPECT_EQ(exponential(-800), 0);
  EXPECT_EQ(exponential(kInfinity), kInfinity);
  EXPECT_EQ(exponential(-kInfinity), 0);
  EXPECT_GT(exponential(709.7), 1e308);
  EXPECT_GT(exponential(-745), 0);
  EXPECT_TRUE(std::isnan(exponential(std::nan(""))));
}

}  // namespace
}  // namespace qmpipe::elementary_test
