#include "stages/point_sets/point_cells.h"

#include <algorithm>
#include <utility>

#include "scheduler/check.h"

namespace qmpipe {

PointCells::PointCells(std::span<const Vec3> points, double radius_m)
    : squared_radius_(radius_m * radius_m), table_(2) {
  QMPIPE_CHECK(radius_m > 0);
  if (points.empty()) return;
  origin_ = points.front();
  Vec3 high = origin_;
  for (const Vec3& p : points) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      origin_[axis] = std::min(origin_[axis], p[axis]);
      high[axis] = std::max(high[axis], p[axis]);
    }
  }
  const Vec3 extent = minus(high, origin_);
  // Larger cells than needed where the radius is tiny, so that keys fit.
  const double widest = *std::max_element(extent.begin(), extent.end());
  cells_per_m_ = 1 / std::max(2 * radius_m, 2 * widest / kMostCells);

  std::vector<std::pair<std::uint64_t, std::uint32_t>> keys;
  keys.reserve(points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    const auto cell = [&](std::size_t axis) {
      return static_cast<std::int64_t>((points[k][axis] - origin_[axis]) * cells_per_m_);
    };
    keys.emplace_back(key_of(cell(0), cell(1), cell(2)), static_cast<std::uint32_t>(k));
  }
  std::sort(keys.begin(), keys.end());
  // At most half full.
  unsigned bits = 1;
  while ((std::size_t{1} << bits) < 2 * keys.size()) ++bits;
  shift_ = 64 - bits;
  table_.assign(std::size_t{1} << bits, {});
  for (const auto& [key, index] : keys) {
    const auto k = static_cast<std::uint32_t>(sorted_.size());
    sorted_.push_back(points[index]);
    index_.push_back(index);
    std::size_t slot = slot_of(key);
    while (table_[slot].begin != table_[slot].end && table_[slot].key != key) {
      slot = slot + 1 == table_.size() ? 0 : slot + 1;
    }
    Cell& cell = table_[slot];
    if (cell.begin == cell.end) cell = {.key = key, .begin = k, .end = k};
    cell.end = k + 1;
  }
}

}  // namespace qmpipe
