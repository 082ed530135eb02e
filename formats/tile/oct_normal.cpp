#include "formats/tile/oct_normal.h"

#include <algorithm>
#include <cmath>

namespace qmpipe {
namespace {

double sign_not_zero(double value) { return value < 0 ? -1.0 : 1.0; }

// Folds the lower half of the octahedron outwards over the square, or back: its own inverse.
std::array<double, 2> folded(double x, double y) {
  return {(1 - std::abs(y)) * sign_not_zero(x), (1 - std::abs(x)) * sign_not_zero(y)};
}

std::uint8_t to_byte(double value) {
  return static_cast<std::uint8_t>(
      std::floor((std::clamp(value, -1.0, 1.0) * 0.5 + 0.5) * 255 + 0.5));
}

}  // namespace

OctNormal encode_oct_normal(const Vec3& normal) {
  const double sum = std::abs(normal[0]) + std::abs(normal[1]) + std::abs(normal[2]);
  std::array<double, 2> xy = {normal[0] / sum, normal[1] / sum};
  if (normal[2] < 0) xy = folded(xy[0], xy[1]);
  return {to_byte(xy[0]), to_byte(xy[1])};
}

Vec3 decode_oct_normal(const OctNormal& encoded) {
  std::array<double, 2> xy = {encoded[0] / 255.0 * 2 - 1, encoded[1] / 255.0 * 2 - 1};
  const double z = 1 - std::abs(xy[0]) - std::abs(xy[1]);
  if (z < 0) xy = folded(xy[0], xy[1]);
  const double length = std::sqrt(xy[0] * xy[0] + xy[1] * xy[1] + z * z);
  return {xy[0] / length, xy[1] / length, z / length};
}

}  // namespace qmpipe
