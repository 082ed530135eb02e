#include "scheduler/elementary.h"

#include <array>
#include <bit>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <numbers>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr double kRadPerDeg = std::numbers::pi / 180.0;
constexpr double kDegPerRad = 180.0 / std::numbers::pi;

// The natural logarithm of 2 as two numbers: whole multiples of the first up to 2^21 are exact.
constexpr double kLn2High = 0x1.62e42feep-1;
constexpr double kLn2Low = 1.9082149292705877e-10;

template <std::size_t kCount>
double polynomial(const std::array<double, kCount>& coefficients, double x) {
  double sum = coefficients[kCount - 1];
  for (std::size_t k = kCount - 1; k-- > 0;) sum = sum * x + coefficients[k];
  return sum;
}

// 1 / first!, 1 / (first + step)! ... with alternating signs where `sign` is -1.
template <std::size_t kCount>
constexpr std::array<double, kCount> inverse_factorials(int first, int step, double sign) {
  std::array<double, kCount> terms{};
  double factor = 1;
  for (std::size_t k = 0; k < kCount; ++k) {
    // Whole numbers up to 22! are exact.
    double factorial = 1;
    for (int n = 2; n <= first + static_cast<int>(k) * step; ++n) factorial *= n;
    terms[k] = factor / factorial;
    factor *= sign;
  }
  return terms;
}

// 1 / first, 1 / (first + 2) ... with alternating signs where `sign` is -1.
template <std::size_t kCount>
constexpr std::array<double, kCount> inverse_odds(int first, double sign) {
  std::array<double, kCount> terms{};
  double factor = 1;
  for (std::size_t k = 0; k < kCount; ++k) {
    terms[k] = factor / (first + 2 * static_cast<int>(k));
    factor *= sign;
  }
  return terms;
}

// Taylor's series throughout: after the arguments have been made small, the first term left out is
// below 2^-56 of the result.
constexpr auto kSine = inverse_factorials<8>(3, 2, -1);
constexpr auto kCosine = inverse_factorials<8>(4, 2, -1);
constexpr auto kExponential = inverse_factorials<12>(2, 1, 1);
constexpr auto kHyperbolicSine = inverse_factorials<9>(3, 2, 1);
constexpr auto kArcTangent = inverse_odds<6>(3, -1);
constexpr auto kLogarithm = inverse_odds<10>(3, 1);

// REQUIRES: |x| <= pi / 4.
SinCos sin_cos_small(double x) {
  const double square = x * x;
  const double half = 0.5 * square;
  const double one_less = 1 - half;
  // What the subtraction rounded away is added to the rest.
  const double lost = (1 - one_less) - half;
  return {.sin = x - x * (square * polynomial(kSine, square)),
          .cos = one_less + (lost + square * square * polynomial(kCosine, square))};
}

// The angles whose tangents are 0, 1/8 ... 1, in degrees, each the sum of two numbers.
struct TwoParts {
  double high;
  double low;
};
constexpr std::array<TwoParts, 9> kAnglesOfEighths = {{{0.0, 0.0},
                                                       {7.125016348901798, -1.2948639595014213e-16},
                                                       {14.036243467926479, -1.178545638282857e-16},
                                                       {20.556045219583464, 7.735753643362621e-16},
                                                       {26.56505117707799, -6.673432494950659e-16},
                                                       {32.005383208083494, 1.8761647814886433e-15},
                                                       {36.86989764584402, 1.3346864989901319e-15},
                                                       {41.18592516570965, -2.0942594695766676e-15},
                                                       {45.0, 0.0}}};

// REQUIRES: 0 <= y <= x, 0 < x; none so large or small that a product of two fails.
double first_octant_deg(double y, double x) {
  const double eighths = std::floor(y / x * 8 + 0.5);
  const double tangent = eighths / 8;
  // Turned back by the angle of the nearest eighth; at most 1/16 is left.
  const double rest = (y - tangent * x) / (x + tangent * y);
  const double square = rest * rest;
  const double rest_rad = rest - rest * (square * polynomial(kArcTangent, square));
  const TwoParts& angle = kAnglesOfEighths[static_cast<std::size_t>(eighths)];
  return angle.high + (angle.low + rest_rad * kDegPerRad);
}

// Exact: one times a power of two. REQUIRES: -1022 <= exponent <= 1023.
double power_of_two(int exponent) {
  return std::bit_cast<double>(static_cast<std::uint64_t>(exponent + 1023) << 52U);
}

}  // namespace

SinCos sin_cos_deg(double angle_deg) {
  QMPIPE_ASSERT(!(std::abs(angle_deg) > 1e6));
  const double quarters = std::floor(angle_deg / 90 + 0.5);
  // Exact: both are multiples of the last bit of the smaller, and their difference is no larger.
  const SinCos small = sin_cos_small((angle_deg - quarters * 90) * kRadPerDeg);
  // Not a whole number where the angle is none.
  if (std::isnan(quarters)) return {.sin = quarters, .cos = quarters};
  // A zero without a sign, whichever way the angle came to a multiple of 90.
  switch (static_cast<std::int64_t>(quarters) & 3) {
    case 0:
      return {.sin = small.sin + 0.0, .cos = small.cos};
    case 1:
      return {.sin = small.cos, .cos = 0.0 - small.sin};
    case 2:
      return {.sin = 0.0 - small.sin, .cos = -small.cos};
    default:
      return {.sin = -small.cos, .cos = small.sin + 0.0};
  }
}

double atan2_deg(double y, double x) {
  if (std::isnan(x) || std::isnan(y)) return std::numeric_limits<double>::quiet_NaN();
  double across = std::abs(y);
  double along = std::abs(x);
  // Two infinities count as equal, as in the C library; against anything else one is all there is.
  if (std::isinf(across) || std::isinf(along)) {
    across = std::isinf(across) ? 1 : 0;
    along = std::isinf(along) ? 1 : 0;
  }
  double angle_deg = 0;
  if (across > 0 || along > 0) {
    // Into the middle of what a double holds; a power of two changes no digit.
    const int exponent = std::ilogb(std::fmax(across, along));
    across = std::scalbn(across, -exponent);
    along = std::scalbn(along, -exponent);
    angle_deg =
        across <= along ? first_octant_deg(across, along) : 90 - first_octant_deg(along, across);
  }
  if (std::signbit(x)) angle_deg = 180 - angle_deg;
  return std::copysign(angle_deg, y);
}

double exponential(double x) {
  if (std::isnan(x)) return x;
  if (x > 709.79) return std::numeric_limits<double>::infinity();
  if (x < -745.2) return 0;
  const double twos = std::floor(x * std::numbers::log2e + 0.5);
  const double rest = (x - twos * kLn2High) - twos * kLn2Low;
  const double value = 1 + (rest + rest * rest * polynomial(kExponential, rest));
  const int exponent = static_cast<int>(twos);
  if (exponent > -1000 && exponent < 1000) return value * power_of_two(exponent);
  return std::scalbn(value, exponent);
}

double hyperbolic_sine(double x) {
  const double size = std::abs(x);
  // Smaller ones would lose digits in the difference.
  if (size < 1) {
    const double square = x * x;
    return x + x * (square * polynomial(kHyperbolicSine, square));
  }
  const double grown = exponential(size);
  return std::copysign((grown - 1 / grown) / 2, x);
}

double logarithm(double x) {
  QMPIPE_ASSERT(x > 0);
  if (std::isinf(x)) return x;
  int exponent = 0;
  double part = std::frexp(x, &exponent);
  if (part < std::numbers::sqrt2 / 2) {
    part *= 2;
    --exponent;
  }
  // log(part) = 2 atanh(ratio), and |ratio| < 0.172.
  const double above = part - 1;
  const double ratio = above / (2 + above);
  const double square = ratio * ratio;
  const double half = 0.5 * above * above;
  // 2 ratio = above - above^2 / 2 + ratio above^2 / 2: so the large part has no rounding error.
  const double rest = ratio * (half + 2 * (square * polynomial(kLogarithm, square)));
  const double twos = exponent;
  return twos * kLn2High + (above - (half - (rest + twos * kLn2Low)));
}

double decimal_logarithm(double x) {
  const double value = logarithm(x) * std::numbers::log10e;
  const double whole = std::floor(value + 0.5);
  if (std::abs(whole) <= 308 && whole_power(10, static_cast<int>(whole)) == x) return whole;
  return value;
}

double power(double x, double y) { return exponential(y * logarithm(x)); }

double whole_power(double x, int n) {
  double product = 1;
  double square = x;
  for (auto left = static_cast<unsigned>(std::abs(n)); left != 0; left /= 2) {
    if (left % 2 == 1) product *= square;
    square *= square;
  }
  return n < 0 ? 1 / product : product;
}

}  // namespace qmpipe
