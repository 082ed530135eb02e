#include "stages/surface/base_tin.h"

#include <gtest/gtest.h>

#include "tests/support/terrain_fixture.h"

namespace qmpipe::base_tin_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

TEST(BaseTin, CoversTheSquareWithEveryFreePostAndTheFixedSidesVertices) {
  for (unsigned sides = 0; sides < 16; ++sides) {
    for (const std::uint64_t seed : {1U, 2U, 3U}) {
      SCOPED_TRACE("sides " + std::to_string(sides) + ", seed " + std::to_string(seed));
      std::mt19937_64 random(16 * seed + sides);
      const TilingScheme scheme(seed == 3 ? Projection::kMercator : Projection::kGeodetic);
      const PostGrid grid = make_tile_grid(scheme, {3, 2, 5});
      const auto heights_m = random_terrain(Terrain::kHills, random);
      const FixedBorders fixed = random_borders(random, sides);
      const Tin tin = base_tin(grid, heights_m, fixed, 0.25);
      ASSERT_EQ(fault_of(grid, tin), "");
      std::int32_t absent = 0;
      for (const Side side : kSides) {
        if (!fixed[index_of(side)]) continue;
        EXPECT_EQ(border_of(tin, side), *fixed[index_of(side)]);
        absent += kTilePosts - fixed[index_of(side)]->count();
      }
      EXPECT_EQ(tin.vertices.size(), kTilePostCount - static_cast<std::size_t>(absent));
    }
  }
}

TEST(BaseTin, WorksForGridsOfAnySize) {
  for (const auto& [width, height] : {std::pair{2, 2}, {2, 9}, {3, 3}, {300, 4}}) {
    const PostGrid grid = make_plane_grid(width, height, 10, 20);
    const std::vector<float> heights_m(grid.post_count(), 3.0F);
    const Tin tin = base_tin(grid, heights_m, {}, 0.5);
    EXPECT_EQ(fault_of(grid, tin), "") << width << " x " << height;
    EXPECT_EQ(tin.triangle_count(), static_cast<std::size_t>(2 * (width - 1) * (height - 1)));
  }
}

TEST(BaseTin, DividesACellBetweenThePostsThatAreNearerInHeight) {
  const PostGrid grid = make_plane_grid(2, 2, 1, 1);
  const auto shared = [&](std::vector<float> heights_m) {
    const Tin tin = base_tin(grid, heights_m, {}, 1);
    std::array<int, 4> uses{};
    for (const std::uint32_t k : tin.indices) ++uses.at(k);
    return uses;
  };
  EXPECT_EQ(shared({5, 0, 9, 5}), (std::array{2, 1, 1, 2}));
  EXPECT_EQ(shared({0, 5, 5, 9}), (std::array{1, 2, 2, 1}));
  EXPECT_EQ(shared({1, 1, 1, 1}), (std::array{2, 1, 1, 2}));
}

}  // namespace
}  // namespace qmpipe::base_tin_test
