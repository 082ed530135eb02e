#include "stages/surface/base_tin.h"

#include <algorithm>
#include <cmath>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

class BaseTin {
 public:
  BaseTin(const PostGrid& grid, std::span<const float> heights_m) : grid_(grid), h_(heights_m) {}

  Tin build(const FixedBorders& fixed, const HeightSteps& height_steps) {
    const bool any_fixed = std::any_of(fixed.begin(), fixed.end(), [](const auto& m) { return m; });
    const std::int32_t ring = any_fixed ? 1 : 0;
    QMPIPE_CHECK(!any_fixed ||
                 (grid_.width_posts == kTilePosts && grid_.height_posts == kTilePosts));
    number_vertices(fixed, height_steps);
    for (std::int32_t j = ring; j + 1 + ring < grid_.height_posts; ++j) {
      for (std::int32_t i = ring; i + 1 + ring < grid_.width_posts; ++i) add_cell(i, j);
    }
    for (const Side side : kSides) {
      if (any_fixed) add_strip(side);
    }
    return std::move(tin_);
  }

 private:
  void number_vertices(const FixedBorders& fixed, const HeightSteps& height_steps) {
    std::vector<std::uint8_t> absent(grid_.post_count(), 0);
    for (const Side side : kSides) {
      const auto& mask = fixed[index_of(side)];
      for (std::int32_t k = 0; mask && k < kTilePosts; ++k) {
        const Post p = side_post(side, k);
        if (!mask->test(k)) absent[static_cast<std::size_t>(grid_.index(p.i, p.j))] = 1;
      }
    }
    number_.assign(grid_.post_count(), 0);
    for (std::size_t post = 0; post < absent.size(); ++post) {
      if (absent[post] != 0) {
        number_[post] = kAbsent;
        continue;
      }
      number_[post] = static_cast<std::uint32_t>(tin_.vertices.size());
      tin_.vertices.push_back(
          vertex_at_post(grid_, static_cast<std::int32_t>(post), h_[post], height_steps));
    }
    tin_.indices.reserve(6 * tin_.vertices.size());
  }

  void add_triangle(std::int32_t a, std::int32_t b, std::int32_t c) {
    for (const std::int32_t post : {a, b, c}) {
      tin_.indices.push_back(number_[static_cast<std::size_t>(post)]);
    }
  }

  void add_cell(std::int32_t i, std::int32_t j) {
    const std::int32_t sw = grid_.index(i, j);
    const std::int32_t se = sw + 1;
    const std::int32_t nw = sw + grid_.width_posts;
    const std::int32_t ne = nw + 1;
    const auto apart = [this](std::int32_t a, std::int32_t b) {
      return std::abs(h_[static_cast<std::size_t>(a)] - h_[static_cast<std::size_t>(b)]);
    };
    if (apart(sw, ne) <= apart(se, nw)) {
      add_triangle(sw, se, ne);
      add_triangle(sw, ne, nw);
    } else {
      add_triangle(sw, se, nw);
      add_triangle(se, ne, nw);
    }
  }

  // Between a side and the row of posts next to it, from the side's first corner to its second as
  // one goes counter-clockwise round the tile.
  void add_strip(Side side) {
    const bool backwards = side == Side::kNorth || side == Side::kWest;
    const auto post_on = [&](std::int32_t k, std::int32_t inwards) {
      Post p = side_post(side, backwards ? kTileIntervals - k : k);
      if (side == Side::kWest) p.i += inwards;
      if (side == Side::kEast) p.i -= inwards;
      if (side == Side::kSouth) p.j += inwards;
      if (side == Side::kNorth) p.j -= inwards;
      return grid_.index(p.i, p.j);
    };
    const auto next_outer = [&](std::int32_t k) {
      do {
        ++k;
      } while (k < kTileIntervals && number_[static_cast<std::size_t>(post_on(k, 0))] == kAbsent);
      return k;
    };
    std::int32_t outer = 0;
    std::int32_t inner = 1;
    while (outer < kTileIntervals || inner < kTileIntervals - 1) {
      const std::int32_t after = outer < kTileIntervals ? next_outer(outer) : outer;
      const bool go_outer =
          inner == kTileIntervals - 1 ||
          (outer < kTileIntervals && std::abs(after - inner) <= std::abs(inner + 1 - outer));
      if (go_outer) {
        add_triangle(post_on(outer, 0), post_on(after, 0), post_on(inner, 1));
        outer = after;
      } else {
        add_triangle(post_on(outer, 0), post_on(inner + 1, 1), post_on(inner, 1));
        ++inner;
      }
    }
  }

  static constexpr std::uint32_t kAbsent = 0xFFFFFFFF;
  const PostGrid& grid_;
  std::span<const float> h_;
  std::vector<std::uint32_t> number_;  // vertex of each post
  Tin tin_;
};

}  // namespace

Tin base_tin(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
             const HeightSteps& height_steps) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  return BaseTin(grid, heights_m).build(fixed, height_steps);
}

}  // namespace qmpipe
