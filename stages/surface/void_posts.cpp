#include "stages/surface/void_posts.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/surface/array_index.h"
#include "stages/surface/triangle_scan.h"

namespace qmpipe {
namespace {

// A grid of means, a void where nothing below is valid; NaN marks it.
struct Means {
  std::int32_t width = 0;
  std::int32_t height = 0;
  std::vector<float> values;

  float& value(std::int32_t i, std::int32_t j) { return values[at(j) * at(width) + at(i)]; }
  float value(std::int32_t i, std::int32_t j) const { return values[at(j) * at(width) + at(i)]; }
};

// The mean of the valid ones of 2 x 2; value_of(i, j) is NaN for a void.
template <class ValueOf>
Means halved(std::int32_t width, std::int32_t height, const ValueOf& value_of) {
  Means coarse{.width = (width + 1) / 2, .height = (height + 1) / 2, .values = {}};
  coarse.values.resize(at(coarse.width) * at(coarse.height));
  for (std::int32_t j = 0; j < coarse.height; ++j) {
    for (std::int32_t i = 0; i < coarse.width; ++i) {
      double sum = 0;
      int count = 0;
      for (std::int32_t y = 2 * j; y < std::min(2 * j + 2, height); ++y) {
        for (std::int32_t x = 2 * i; x < std::min(2 * i + 2, width); ++x) {
          const float value = value_of(x, y);
          if (std::isnan(value)) continue;
          sum += static_cast<double>(value);
          ++count;
        }
      }
      coarse.value(i, j) =
          count == 0 ? std::numeric_limits<float>::quiet_NaN() : static_cast<float>(sum / count);
    }
  }
  return coarse;
}

// The coarse grid without voids at a place of the finer one: weights 3/4 and 1/4 on each axis, because
// a coarse value stands in the middle of its four.
float interpolated(const Means& coarse, std::int32_t i, std::int32_t j) {
  const std::int32_t i0 = i / 2;
  const std::int32_t j0 = j / 2;
  const std::int32_t i1 = std::clamp(i % 2 == 0 ? i0 - 1 : i0 + 1, 0, coarse.width - 1);
  const std::int32_t j1 = std::clamp(j % 2 == 0 ? j0 - 1 : j0 + 1, 0, coarse.height - 1);
  const double near = 0.75 * static_cast<double>(coarse.value(i0, j0)) +
                      0.25 * static_cast<double>(coarse.value(i1, j0));
  const double far = 0.75 * static_cast<double>(coarse.value(i0, j1)) +
                     0.25 * static_cast<double>(coarse.value(i1, j1));
  return static_cast<float>(0.75 * near + 0.25 * far);
}

struct PostCount {
  std::int64_t all = 0;
  std::int64_t valid = 0;
};

std::int32_t nearest_post(const PostGrid& grid, double u, double v) {
  const auto i = std::lround(u * grid.columns_per_u());
  const auto j = std::lround(v / grid.v_exact.back() * (grid.height_posts - 1));
  return grid.index(static_cast<std::int32_t>(i), static_cast<std::int32_t>(j));
}

bool is_mostly_void(const PostGrid& grid, const IntPoint& a, const IntPoint& b, const IntPoint& c,
                    std::span<const std::uint8_t> valid) {
  PostCount count;
  const PostRows rows = rows_of_triangle(grid, a, b, c, kRoundingMargin);
  scan_triangle(grid, a, b, c, kRoundingMargin, rows.first, rows.last,
                [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
                  for (std::int32_t i = i_first; i <= i_last; ++i) {
                    ++count.all;
                    count.valid += valid[at(grid.index(i, j))] != 0 ? 1 : 0;
                  }
                });
  if (count.all > 0) return 2 * count.valid < count.all;
  return valid[at(nearest_post(grid, (a.x + b.x + c.x) / 3.0, (a.y + b.y + c.y) / 3.0))] == 0;
}

void drop_unused_vertices(Tin& tin) {
  constexpr std::uint32_t kUnused = std::numeric_limits<std::uint32_t>::max();
  std::vector<std::uint32_t> number(tin.vertices.size(), kUnused);
  for (const std::uint32_t index : tin.indices) number[index] = 0;
  std::uint32_t kept = 0;
  for (std::size_t k = 0; k < tin.vertices.size(); ++k) {
    if (number[k] == kUnused) continue;
    tin.vertices[kept] = tin.vertices[k];
    number[k] = kept++;
  }
  tin.vertices.resize(kept);
  for (std::uint32_t& index : tin.indices) index = number[index];
}

}  // namespace

void fill_voids(std::int32_t width_posts, std::int32_t height_posts,
                std::span<const std::uint8_t> valid, std::span<float> heights_m) {
  QMPIPE_CHECK(valid.size() == at(width_posts) * at(height_posts));
  QMPIPE_CHECK(heights_m.size() == valid.size());
  QMPIPE_CHECK(std::any_of(valid.begin(), valid.end(), [](std::uint8_t v) { return v != 0; }));
  const auto has_void = [](const Means& means) {
    return std::any_of(means.values.begin(), means.values.end(),
                       [](float value) { return std::isnan(value); });
  };
  // From fine to coarse until nothing is void, which one value for all never is.
  std::vector<Means> levels;
  levels.push_back(halved(width_posts, height_posts, [&](std::int32_t i, std::int32_t j) {
    const std::size_t k = at(j) * at(width_posts) + at(i);
    return valid[k] != 0 ? heights_m[k] : std::numeric_limits<float>::quiet_NaN();
  }));
  while (has_void(levels.back())) {
    const Means& finest = levels.back();
    levels.push_back(halved(finest.width, finest.height, [&finest](std::int32_t i, std::int32_t j) {
      return finest.value(i, j);
    }));
  }
  for (; levels.size() > 1; levels.pop_back()) {
    Means& finer = levels[levels.size() - 2];
    for (std::int32_t j = 0; j < finer.height; ++j) {
      for (std::int32_t i = 0; i < finer.width; ++i) {
        if (std::isnan(finer.value(i, j))) finer.value(i, j) = interpolated(levels.back(), i, j);
      }
    }
  }
  for (std::int32_t j = 0; j < height_posts; ++j) {
    for (std::int32_t i = 0; i < width_posts; ++i) {
      const std::size_t k = at(j) * at(width_posts) + at(i);
      if (valid[k] == 0) heights_m[k] = interpolated(levels.front(), i, j);
    }
  }
}

Tin without_void_triangles(const PostGrid& grid, Tin tin, std::span<const std::uint8_t> valid) {
  QMPIPE_CHECK(valid.size() == grid.post_count());
  const auto place = [&tin](std::uint32_t vertex) {
    return IntPoint{tin.vertices[vertex].u, tin.vertices[vertex].v};
  };
  std::size_t kept = 0;
  for (std::size_t t = 0; t < tin.indices.size(); t += 3) {
    if (is_mostly_void(grid, place(tin.indices[t]), place(tin.indices[t + 1]),
                       place(tin.indices[t + 2]), valid)) {
      continue;
    }
    for (std::size_t k = 0; k < 3; ++k) tin.indices[kept++] = tin.indices[t + k];
  }
  tin.indices.resize(kept);
  drop_unused_vertices(tin);
  return tin;
}

}  // namespace qmpipe
