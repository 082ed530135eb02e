// Finds the points within a radius of a place, fast, whatever their number: points in the cells of a
// cubic grid, cells in a hash table.
//
// Guarantees: points within the radius come, each once, in an order that depends on the points and
// the radius alone. const use is safe from several threads.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <span>
#include <vector>

#include "stages/surface/geodesy.h"

namespace qmpipe {

class PointCells {
 public:
  // REQUIRES: radius_m > 0; finite points.
  PointCells(std::span<const Vec3> points, double radius_m);

  // Calls visit(index, squared distance) for each point no farther than the radius.
  template <class Visit>
  void for_each_near(const Vec3& centre, const Visit& visit) const {
    // A cell is two radii wide, so a ball touches two along each axis at most.
    std::array<std::int64_t, 3> low{};
    for (std::size_t axis = 0; axis < 3; ++axis) {
      low[axis] = static_cast<std::int64_t>(
          std::floor((centre[axis] - origin_[axis]) * cells_per_m_ - 0.5));
    }
    for (unsigned corner = 0; corner < 8; ++corner) {
      const Cell& cell =
          cell_at(low[0] + (corner & 1U), low[1] + (corner >> 1U & 1U), low[2] + (corner >> 2U));
      for (std::uint32_t k = cell.begin; k < cell.end; ++k) {
        const Vec3 d = minus(sorted_[k], centre);
        const double squared = dot(d, d);
        if (squared <= squared_radius_) visit(index_[k], squared);
      }
    }
  }

 private:
  struct Cell {
    std::uint64_t key = 0;
    std::uint32_t begin = 0;
    std::uint32_t end = 0;  // begin: no cell
  };
  static constexpr std::int64_t kMostCells = std::int64_t{1} << 21;  // along an axis
  static std::uint64_t key_of(std::int64_t x, std::int64_t y, std::int64_t z) {
    return static_cast<std::uint64_t>(x) | static_cast<std::uint64_t>(y) << 21U |
           static_cast<std::uint64_t>(z) << 42U;
  }
  std::size_t slot_of(std::uint64_t key) const {
    return static_cast<std::size_t>(key * 0x9E3779B97F4A7C15ULL >> shift_);
  }
  const Cell& cell_at(std::int64_t x, std::int64_t y, std::int64_t z) const {
    constexpr static Cell kNoCell{};
    if (x < 0 || y < 0 || z < 0 || x >= kMostCells || y >= kMostCells || z >= kMostCells) {
      return kNoCell;
    }
    const std::uint64_t key = key_of(x, y, z);
    std::size_t slot = slot_of(key);
    while (table_[slot].begin != table_[slot].end && table_[slot].key != key) {
      slot = slot + 1 == table_.size() ? 0 : slot + 1;
    }
    return table_[slot];
  }

  double squared_radius_;
  double cells_per_m_ = 0;
  Vec3 origin_{};
  unsigned shift_ = 63;
  std::vector<Vec3> sorted_;          // by cell
  std::vector<std::uint32_t> index_;  // of each in the span that was given
  std::vector<Cell> table_;
};

}  // namespace qmpipe
