// Where a split's point is expected, from what the splits before it tell: what the file of a
// detail-increment model holds is the difference.
//
// The split's half-edge belongs to a triangle, and the expected point is the mean of the three
// points that triangle had when it was made. Its corners may have moved on to other points since;
// which, only the walk through all levels knows, but they are near. So no walk is needed to read
// a file. When a split makes its triangles (v, r, u) and (v, u, l), v, r and l are taken from the
// half-edge's triangle in the same way.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/detail_model/data.h"

namespace qmpipe {

class DetailPrediction {
 public:
  DetailPrediction(std::span<const std::uint32_t> coarse_triangles, std::size_t splits)
      : corners_(coarse_triangles.begin(), coarse_triangles.end()) {
    corners_.reserve(corners_.size() + 6 * splits);
  }

  // REQUIRES: half_edge < 3 * triangles so far; `points` has all points so far.
  DetailPoint expect(std::uint32_t half_edge, std::span<const DetailPoint> points) const {
    const std::size_t first = half_edge - half_edge % 3;
    const DetailPoint& a = points[corners_[first]];
    const DetailPoint& b = points[corners_[first + 1]];
    const DetailPoint& c = points[corners_[first + 2]];
    return {.x = mean(a.x, b.x, c.x), .y = mean(a.y, b.y, c.y), .z = mean(a.z, b.z, c.z)};
  }

  // The split at half_edge has made `point`.
  void add(std::uint32_t half_edge, std::uint32_t point) {
    const std::size_t first = half_edge - half_edge % 3;
    const std::uint32_t v = corners_[half_edge];
    const std::uint32_t r = corners_[first + (half_edge + 1) % 3];
    const std::uint32_t l = corners_[first + (half_edge + 2) % 3];
    corners_.insert(corners_.end(), {v, r, point, v, point, l});
  }

 private:
  // Rounded down, for negative sums as well.
  static std::int32_t mean(std::int64_t a, std::int64_t b, std::int64_t c) {
    const std::int64_t sum = a + b + c;
    return static_cast<std::int32_t>(sum / 3 - (sum % 3 < 0 ? 1 : 0));
  }

  std::vector<std::uint32_t> corners_;  // by half-edge: the point it left when it was made
};

// Differences wrap, so that every pair of numbers has one.
constexpr std::uint32_t zig_zag(std::uint32_t value, std::uint32_t expected) {
  const std::uint32_t difference = value - expected;
  return (difference << 1U) ^ (0U - (difference >> 31U));
}
constexpr std::uint32_t undo_zig_zag(std::uint32_t code, std::uint32_t expected) {
  return expected + ((code >> 1U) ^ (0U - (code & 1U)));
}

}  // namespace qmpipe
