// Finds the nearest of many points or triangles on the ground, for Hausdorff distances.
//
// Frame: metres east, north and up of a place on the ground (GroundFrame). The grid lies in the
// first two; a distance seen there never exceeds the true one, which is all the search relies on.
// Guarantees: exact; the grid only saves work. Memory is bounded by 16 entries of four bytes for
// each item, whatever their shapes. Thread rule: const use is safe.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <numeric>
#include <span>
#include <vector>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

using Triangle = std::array<Vec3, 3>;

// Turns ECEF round, without stretching, so that the middle of the given points looks up.
class GroundFrame {
 public:
  explicit GroundFrame(std::span<const Vec3> points_ecef);
  std::vector<Vec3> turned(std::span<const Vec3> points_ecef) const;

 private:
  Vec3 origin_{};
  std::array<Vec3, 3> axes_ = {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
};

inline double squared_distance(const Vec3& p, const Vec3& point) {
  const double x = p[0] - point[0];
  const double y = p[1] - point[1];
  const double z = p[2] - point[2];
  return x * x + y * y + z * z;
}
// To the nearest place of the triangle, also of one without an area.
double squared_distance(const Vec3& p, const Triangle& triangle);

// Items in square cells, about two in each; an item lies in every cell that its box touches.
template <class Item>
class NearestGrid {
 public:
  // `asked`: the points that will be asked about; the cells reach them too.
  // REQUIRES: neither is empty; fewer than 2^32 items.
  NearestGrid(std::vector<Item> items, std::span<const Vec3> asked) : items_(std::move(items)) {
    std::vector<Box> boxes;
    boxes.reserve(items_.size());
    for (const Item& item : items_) boxes.push_back(box_of(item));
    measure(boxes, asked);
    while (entry_count(boxes) > 16 * items_.size()) set_cell(2 * cell_m_);
    starts_.assign(cell_index(columns_ - 1, rows_ - 1) + 2, 0);
    for_each_entry(boxes, [this](std::size_t cell, std::uint32_t) { ++starts_[cell + 1]; });
    std::partial_sum(starts_.begin(), starts_.end(), starts_.begin());
    entries_.resize(starts_.back());
    std::vector<std::uint32_t> next(starts_.begin(), starts_.end() - 1);
    for_each_entry(boxes,
                   [&](std::size_t cell, std::uint32_t item) { entries_[next[cell]++] = item; });
  }

  // The squared distance to the nearest item; when that is not above `enough`, any number that is
  // not above it either.
  double nearest_squared(const Vec3& p, double enough) const {
    const std::int32_t column = column_of(p[0]);
    const std::int32_t row = row_of(p[1]);
    double best = std::numeric_limits<double>::infinity();
    for (std::int32_t ring = 0; ring <= std::max(columns_, rows_); ++ring) {
      const double nearest_possible = std::max(0, ring - 1) * cell_m_;
      if (best <= std::max(enough, nearest_possible * nearest_possible)) break;
      best = std::min(best, nearest_in_ring(p, column, row, ring));
    }
    return best;
  }

 private:
  struct Box {
    double west = std::numeric_limits<double>::infinity();
    double south = std::numeric_limits<double>::infinity();
    double east = -std::numeric_limits<double>::infinity();
    double north = -std::numeric_limits<double>::infinity();

    void add(const Vec3& p) {
      west = std::min(west, p[0]);
      south = std::min(south, p[1]);
      east = std::max(east, p[0]);
      north = std::max(north, p[1]);
    }
  };

  static Box box_of(const Vec3& point) {
    return {.west = point[0], .south = point[1], .east = point[0], .north = point[1]};
  }
  static Box box_of(const Triangle& triangle) {
    Box box;
    for (const Vec3& corner : triangle) box.add(corner);
    return box;
  }

  void measure(const std::vector<Box>& boxes, std::span<const Vec3> asked) {
    for (const Box& box : boxes) {
      bounds_.add({box.west, box.south, 0});
      bounds_.add({box.east, box.north, 0});
    }
    for (const Vec3& p : asked) bounds_.add(p);
    const double width_m = bounds_.east - bounds_.west;
    const double height_m = bounds_.north - bounds_.south;
    // Never more than 1024 cells along the longer side, however narrow the set is.
    set_cell(std::max({std::sqrt(2 * width_m * height_m / static_cast<double>(boxes.size())),
                       std::max(width_m, height_m) / 1024, 1e-6}));
  }
  void set_cell(double cell_m) {
    cell_m_ = cell_m;
    columns_ = static_cast<std::int32_t>((bounds_.east - bounds_.west) / cell_m_) + 1;
    rows_ = static_cast<std::int32_t>((bounds_.north - bounds_.south) / cell_m_) + 1;
  }

  std::size_t entry_count(const std::vector<Box>& boxes) const {
    std::size_t count = 0;
    for (const Box& box : boxes) {
      count += static_cast<std::size_t>(column_of(box.east) - column_of(box.west) + 1) *
               static_cast<std::size_t>(row_of(box.north) - row_of(box.south) + 1);
    }
    return count;
  }
  template <class Visit>
  void for_each_entry(const std::vector<Box>& boxes, const Visit& visit) const {
    for (std::size_t k = 0; k < boxes.size(); ++k) {
      const std::int32_t first = column_of(boxes[k].west);
      const std::int32_t last = column_of(boxes[k].east);
      const std::int32_t top = row_of(boxes[k].north);
      for (std::int32_t row = row_of(boxes[k].south); row <= top; ++row) {
        for (std::int32_t column = first; column <= last; ++column) {
          visit(cell_index(column, row), static_cast<std::uint32_t>(k));
        }
      }
    }
  }

  std::int32_t column_of(double x) const {
    return std::clamp(static_cast<std::int32_t>((x - bounds_.west) / cell_m_), 0, columns_ - 1);
  }
  std::int32_t row_of(double y) const {
    return std::clamp(static_cast<std::int32_t>((y - bounds_.south) / cell_m_), 0, rows_ - 1);
  }
  std::size_t cell_index(std::int32_t column, std::int32_t row) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(columns_) +
           static_cast<std::size_t>(column);
  }

  double nearest_in_cells(const Vec3& p, std::int32_t row, std::int32_t first,
                          std::int32_t last) const {
    double best = std::numeric_limits<double>::infinity();
    first = std::max(first, 0);
    last = std::min(last, columns_ - 1);
    if (row < 0 || row >= rows_ || first > last) return best;
    const std::size_t end = starts_[cell_index(last, row) + 1];
    for (std::size_t k = starts_[cell_index(first, row)]; k < end; ++k) {
      best = std::min(best, squared_distance(p, items_[entries_[k]]));
    }
    return best;
  }

  double nearest_in_ring(const Vec3& p, std::int32_t column, std::int32_t row,
                         std::int32_t ring) const {
    double best = nearest_in_cells(p, row - ring, column - ring, column + ring);
    if (ring == 0) return best;
    best = std::min(best, nearest_in_cells(p, row + ring, column - ring, column + ring));
    for (std::int32_t r = row - ring + 1; r < row + ring; ++r) {
      best = std::min({best, nearest_in_cells(p, r, column - ring, column - ring),
                       nearest_in_cells(p, r, column + ring, column + ring)});
    }
    return best;
  }

  std::vector<Item> items_;
  Box bounds_;
  double cell_m_ = 1;
  std::int32_t columns_ = 1;
  std::int32_t rows_ = 1;
  std::vector<std::uint32_t> starts_;   // by cell, where its entries start
  std::vector<std::uint32_t> entries_;  // items, cell by cell
};

}  // namespace qmpipe
