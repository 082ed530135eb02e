// Gradient noise (after Perlin) in three dimensions, evaluated for many points at a time.
//
// Guarantees: a value is a pure function of (seed, frequency, point), whatever points come with it.
// The same bits on every machine with IEEE arithmetic: no tables, no libm. Values lie in about
// [-1, 1], their mean is 0, the distance between features about 1 / frequency.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace qmpipe {

// Points, one array for each axis; coordinates in [-2, 2]. Neighbours in the list should be
// neighbours in space: that is what makes it fast.
struct NoisePoints {
  std::array<std::vector<double>, 3> axes;

  std::size_t size() const { return axes[0].size(); }
  void resize(std::size_t count) {
    for (std::vector<double>& axis : axes) axis.resize(count);
  }
};

class GradientNoise {
 public:
  // REQUIRES: 0 < frequency < 2^28.
  GradientNoise(std::uint32_t seed, double frequency) : seed_(seed), frequency_(frequency) {}
  // REQUIRES: out.size() == points.size().
  void sample(const NoisePoints& points, std::span<float> out);

 private:
  using Corners = std::array<std::array<float, 8>, 3>;
  Corners corners_of(const std::array<std::int32_t, 3>& cell) const;

  std::uint32_t seed_;
  double frequency_;
  // Buffers kept between calls: each point's cell, and its place in it.
  std::array<std::vector<std::int32_t>, 3> cells_;
  std::array<std::vector<float>, 3> parts_;
};

// Spreads every bit of the input over the whole word (C. Wellons' lowbias32).
constexpr std::uint32_t mixed(std::uint32_t word) {
  word ^= word >> 16U;
  word *= 0x7FEB352DU;
  word ^= word >> 15U;
  word *= 0x846CA68BU;
  word ^= word >> 16U;
  return word;
}

}  // namespace qmpipe
