#include "formats/points/point_grid.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <tuple>

#include "scheduler/check.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr double kHalfGrid = 0x1p29;
// A survey's stray points are fewer; more than that are part of it.
constexpr std::size_t kPointsPerStray = 1000;
// A step in y that is this many times that in x (near the poles) does not make the grid finer still.
constexpr double kMostRefined = 16;

double middle_of(const std::vector<PointPlace>& values, std::size_t axis) {
  std::vector<double> along(values.size());
  std::transform(values.begin(), values.end(), along.begin(),
                 [axis](const PointPlace& p) { return p[axis]; });
  const auto middle = along.begin() + static_cast<std::ptrdiff_t>(along.size() / 2);
  std::nth_element(along.begin(), middle, along.end());
  return *middle;
}

// The integers of one axis that the grid holds, and which of them becomes 0.
struct Window {
  double low = 0;
  double high = 0;
  double zero = 0;
  // False for what is no number too.
  bool holds(double value) const { return value >= low && value <= high; }
};

struct Extent {
  double low = std::numeric_limits<double>::infinity();
  double high = -low;
  double length() const { return high - low; }
};

Extent extent_of(const std::vector<PointPlace>& values, std::size_t axis) {
  Extent extent;
  for (const PointPlace& p : values) {
    extent.low = std::min(extent.low, p[axis]);
    extent.high = std::max(extent.high, p[axis]);
  }
  return extent;
}

Window window_of(const std::vector<PointPlace>& values, std::size_t axis) {
  const auto [low, high] = extent_of(values, axis);
  // Heights need not start at 0, so that a LAS file's stay as they are.
  if (axis == 2 && low >= -2 * kHalfGrid && high < 2 * kHalfGrid) {
    return {.low = low, .high = high, .zero = 0};
  }
  if (high - low <= kDetailGridMax) return {.low = low, .high = high, .zero = low};
  const double from = middle_of(values, axis) - kHalfGrid;
  return {.low = from, .high = from + kDetailGridMax, .zero = from};
}

// Factors from values to integers of the grid.
PointPlace grid_factors(const RawPoints& raw, const std::array<double, 3>& units_m) {
  const double x_m = raw.step[0] * units_m[0];
  const double y_m = raw.step[1] * units_m[1];
  if (x_m == y_m) return {1, 1, 1};
  // Not coarser than the finer one, so that no two points fall together.
  const double finer_m = std::max(std::min(x_m, y_m), std::max(x_m, y_m) / kMostRefined);
  PointPlace factors = {x_m / finer_m, y_m / finer_m, 1};
  // Finer by a digit where the grid has room, so that points move by a twentieth of their own step.
  const bool is_exact =
      factors[0] == std::floor(factors[0]) && factors[1] == std::floor(factors[1]);
  for (std::size_t axis = 0; axis < 2 && !is_exact; ++axis) {
    if (extent_of(raw.values, axis).length() * factors[axis] * 10 > kDetailGridMax) return factors;
  }
  if (!is_exact) factors = {factors[0] * 10, factors[1] * 10, 1};
  return factors;
}

std::optional<Error> drop_strays(RawPoints& raw, const std::array<Window, 3>& windows,
                                 PointCounts& counts) {
  const std::size_t count = raw.values.size();
  std::array<std::size_t, 3> outside{};
  for (const PointPlace& p : raw.values) {
    for (std::size_t axis = 0; axis < 3; ++axis)
      if (!windows[axis].holds(p[axis])) ++outside[axis];
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (outside[axis] <= count / kPointsPerStray) continue;
    return Error{
        fmt::format("{} of its {} points are more than 2^29 steps of {:g} from the middle of {}",
                    outside[axis], count, raw.step[axis], "xyz"[axis])};
  }
  const auto is_stray = [&](const PointPlace& p) {
    return !windows[0].holds(p[0]) || !windows[1].holds(p[1]) || !windows[2].holds(p[2]);
  };
  raw.values.erase(std::remove_if(raw.values.begin(), raw.values.end(), is_stray),
                   raw.values.end());
  counts.off_grid += count - raw.values.size();
  return std::nullopt;
}

void keep_lowest_of_each_place(PointCloud& cloud) {
  std::vector<DetailPoint>& points = cloud.points;
  std::sort(points.begin(), points.end(), [](const DetailPoint& a, const DetailPoint& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
  });
  const auto end = std::unique(
      points.begin(), points.end(),
      [](const DetailPoint& a, const DetailPoint& b) { return a.x == b.x && a.y == b.y; });
  cloud.counts.same_place += static_cast<std::uint64_t>(points.end() - end);
  points.erase(end, points.end());
}

// The two lowest and the two highest of some heights: the range of all but any one of them.
struct Range {
  std::int64_t low = std::numeric_limits<std::int64_t>::max();
  std::int64_t next_low = low;
  std::int64_t high = std::numeric_limits<std::int64_t>::min();
  std::int64_t next_high = high;
  std::uint64_t count = 0;

  void add(std::int64_t z) {
    next_low = std::min(next_low, std::max(low, z));
    low = std::min(low, z);
    next_high = std::max(next_high, std::min(high, z));
    high = std::max(high, z);
    ++count;
  }
  void add(const Range& other) {
    next_low = std::min({next_low, other.next_low, std::max(low, other.low)});
    low = std::min(low, other.low);
    next_high = std::max({next_high, other.next_high, std::min(high, other.high)});
    high = std::max(high, other.high);
    count += other.count;
  }
};

// Cells of some four points each.
class HeightCells {
 public:
  explicit HeightCells(const std::vector<DetailPoint>& points) {
    std::int32_t width = 0;
    std::int32_t height = 0;
    for (const DetailPoint& p : points) {
      width = std::max(width, p.x);
      height = std::max(height, p.y);
    }
    const double cells = std::max(1.0, static_cast<double>(points.size()) / 4);
    const double area = (width + 1.0) * (height + 1.0);
    // Where all points stand in a row, cells longer than wide would be more than there are points.
    side_ = std::max(std::sqrt(area / cells), std::max(width + 1.0, height + 1.0) / cells);
    columns_ = static_cast<std::int64_t>((width + 1.0) / side_) + 1;
    rows_ = static_cast<std::int64_t>((height + 1.0) / side_) + 1;
    ranges_.resize(static_cast<std::size_t>(columns_ * rows_));
    for (const DetailPoint& p : points) ranges_[at(column_of(p), row_of(p))].add(p.z);
  }

  Range around(const DetailPoint& p) const {
    Range range;
    for (std::int64_t r = std::max<std::int64_t>(0, row_of(p) - 1);
         r <= std::min(rows_ - 1, row_of(p) + 1); ++r) {
      for (std::int64_t c = std::max<std::int64_t>(0, column_of(p) - 1);
           c <= std::min(columns_ - 1, column_of(p) + 1); ++c) {
        range.add(ranges_[at(c, r)]);
      }
    }
    return range;
  }

 private:
  std::int64_t column_of(const DetailPoint& p) const {
    return static_cast<std::int64_t>(p.x / side_);
  }
  std::int64_t row_of(const DetailPoint& p) const { return static_cast<std::int64_t>(p.y / side_); }
  std::size_t at(std::int64_t column, std::int64_t row) const {
    return static_cast<std::size_t>(row * columns_ + column);
  }

  double side_ = 1;
  std::int64_t columns_ = 1;
  std::int64_t rows_ = 1;
  std::vector<Range> ranges_;
};

void drop_outliers(double outlier_m, PointCloud& cloud) {
  constexpr std::uint64_t kLeastOthers = 3;
  const HeightCells cells(cloud.points);
  const double step_m = cloud.frame.step_m[2];
  const auto is_outlier = [&](const DetailPoint& p) {
    const Range range = cells.around(p);
    if (range.count < kLeastOthers + 1) return false;
    // Among the others: the next ones, where the point itself is the highest or lowest.
    if (p.z == range.high && static_cast<double>(p.z - range.next_high) * step_m > outlier_m) {
      return true;
    }
    return p.z == range.low && static_cast<double>(range.next_low - p.z) * step_m > outlier_m;
  };
  const auto end = std::remove_if(cloud.points.begin(), cloud.points.end(), is_outlier);
  cloud.counts.outliers += static_cast<std::uint64_t>(cloud.points.end() - end);
  cloud.points.erase(end, cloud.points.end());
}

// x and y are to start at 0 also when the first points went.
void shift_to_zero(PointCloud& cloud) {
  if (cloud.points.empty()) return;
  DetailPoint low = cloud.points.front();
  for (const DetailPoint& p : cloud.points) low.y = std::min(low.y, p.y);
  for (DetailPoint& p : cloud.points) {
    p.x -= low.x;
    p.y -= low.y;
  }
  cloud.frame.offset[0] += cloud.frame.step_m[0] * low.x;
  cloud.frame.offset[1] += cloud.frame.step_m[1] * low.y;
}

// Would all but strays be on a grid of this many steps a unit?
bool fits(const std::vector<PointPlace>& values, std::size_t axis, double middle, double steps) {
  const double half = kHalfGrid - 1;
  const auto outside = static_cast<std::size_t>(std::count_if(
      values.begin(), values.end(),
      [&](const PointPlace& p) { return !(std::abs(p[axis] - middle) * steps <= half); }));
  return outside <= values.size() / kPointsPerStray;
}

}  // namespace

SquareThinner::SquareThinner(RawPoints& points, const std::array<double, 2>& side)
    : points_(&points), side_(side) {
  for (const double s : side) QMPIPE_CHECK(s > 0);
}

std::size_t SquareThinner::HashSquare::operator()(const Square& square) const {
  // Small numbers differ in a double's upper bits only, so these are brought down before each product.
  const auto mix = [](std::uint64_t state, double number) {
    // Adding 0 takes the sign from -0, which equals 0.
    const auto bits = std::bit_cast<std::uint64_t>(number + 0.0);
    state = (state ^ bits ^ (bits >> 32U)) * 0x9E3779B97F4A7C15ULL;
    return state ^ (state >> 32U);
  };
  return static_cast<std::size_t>(mix(mix(0, square.column), square.row));
}

std::array<double, 2> SquareThinner::from_centre(const PointPlace& value, Square& square) const {
  const double x = (points_->offset[0] + points_->step[0] * value[0]) / side_[0];
  const double y = (points_->offset[1] + points_->step[1] * value[1]) / side_[1];
  square = {.column = std::floor(x), .row = std::floor(y)};
  return {x - square.column - 0.5, y - square.row - 0.5};
}

bool SquareThinner::is_better(const PointPlace& a, const PointPlace& b) const {
  Square ignored{};
  const auto [ax, ay] = from_centre(a, ignored);
  const auto [bx, by] = from_centre(b, ignored);
  return std::tuple(ax * ax + ay * ay, a[2], a[0], a[1]) <
         std::tuple(bx * bx + by * by, b[2], b[0], b[1]);
}

bool SquareThinner::add(const PointPlace& value) {
  Square square{};
  from_centre(value, square);
  const auto [place, is_first] = kept_.try_emplace(square, points_->values.size());
  if (is_first) {
    points_->values.push_back(value);
    return false;
  }
  PointPlace& kept = points_->values[place->second];
  if (is_better(value, kept)) kept = value;
  return true;
}

void round_to_decimals(RawPoints& points, const std::array<int, 2>& decimals, double fewest_steps) {
  if (points.values.empty()) return;
  std::array<double, 2> steps = {whole_power(10, decimals[0]), whole_power(10, decimals[1])};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    double& s = steps[axis / 2];
    const double middle = middle_of(points.values, axis);
    const double fewest = axis < 2 ? fewest_steps : 1;
    while (s > fewest && !fits(points.values, axis, middle, s)) s = std::round(s / 10);
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const double s = steps[axis / 2];
    for (PointPlace& p : points.values) p[axis] = std::nearbyint(p[axis] * s);
    points.step[axis] = 1 / s;
  }
}

std::optional<Error> put_on_grid(RawPoints raw, double outlier_m, PointCloud& cloud) {
  const PointPlace factors = grid_factors(raw, cloud.units_m);
  std::array<Window, 3> windows;
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (factors[axis] != 1) {
      for (PointPlace& p : raw.values) p[axis] = std::nearbyint(p[axis] * factors[axis]);
      raw.step[axis] /= factors[axis];
    }
    windows[axis] = window_of(raw.values, axis);
  }
  if (auto error = drop_strays(raw, windows, cloud.counts)) return error;
  cloud.points.reserve(raw.values.size());
  for (const PointPlace& p : raw.values) {
    cloud.points.push_back({.x = static_cast<std::int32_t>(p[0] - windows[0].zero),
                            .y = static_cast<std::int32_t>(p[1] - windows[1].zero),
                            .z = static_cast<std::int32_t>(p[2] - windows[2].zero)});
  }
  raw.values = {};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    cloud.frame.step_m[axis] = raw.step[axis] * cloud.units_m[axis];
    cloud.frame.offset[axis] =
        raw.offset[axis] * cloud.units_m[axis] + cloud.frame.step_m[axis] * windows[axis].zero;
  }
  // The same but for rounding; one grid has one step.
  cloud.frame.step_m[1] = cloud.frame.step_m[0];
  keep_lowest_of_each_place(cloud);
  shift_to_zero(cloud);
  if (outlier_m > 0) {
    drop_outliers(outlier_m, cloud);
    shift_to_zero(cloud);
  }
  return std::nullopt;
}

}  // namespace qmpipe
