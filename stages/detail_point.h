// A point of a detail-increment model, on the integer grid that all points of the model share.
//
// Integers make planar tests exact and the stored form small. A LAS file brings its grid along; a
// DEM's columns and rows are one.
#pragma once

#include <array>
#include <cstdint>

namespace qmpipe {

struct DetailPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  friend bool operator==(const DetailPoint&, const DetailPoint&) = default;
};

// x and y lie in 0..kDetailGridMax, so that products of differences fit 64 bits.
inline constexpr std::int32_t kDetailGridMax = (std::int32_t{1} << 30) - 1;

// Twice the signed area of abc in the plane: positive when counter-clockwise. Exact.
constexpr std::int64_t plane_orientation(const DetailPoint& a, const DetailPoint& b,
                                         const DetailPoint& c) {
  return std::int64_t{b.x - a.x} * (c.y - a.y) - std::int64_t{b.y - a.y} * (c.x - a.x);
}

// Where the grid lies: coordinate = offset + step * integer, per axis. Steps are positive and, like
// all distances of the model, in metres.
struct DetailFrame {
  std::array<double, 3> offset{};
  std::array<double, 3> step_m = {1, 1, 1};
  friend bool operator==(const DetailFrame&, const DetailFrame&) = default;

  std::array<double, 3> place(const DetailPoint& p) const {
    return {offset[0] + step_m[0] * p.x, offset[1] + step_m[1] * p.y, offset[2] + step_m[2] * p.z};
  }
};

}  // namespace qmpipe
