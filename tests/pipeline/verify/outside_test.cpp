#include "pipeline/verify/outside.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

#include "stages/finish/mesh_order.h"
#include "stages/finish/quantize.h"
#include "stages/greedy/greedy.h"

namespace qmpipe::testing::outside_test {
namespace {

const TilingScheme kGeodetic(Projection::kGeodetic);
constexpr TileKey kTile = {.zoom = 14, .x = 17000, .y = 12001};
constexpr double kToleranceM = 0.5;

// Data in the west half, heights by post.
struct TileFixture {
  QuantizedMesh mesh;
  std::vector<std::uint8_t> valid;
  TileKey key;

  TileFixture(const TileKey& tile, const std::function<double(int, int)>& height_m) : key(tile) {
    const PostGrid grid = make_tile_grid(kGeodetic, key);
    std::vector<float> heights_m(kTilePostCount);
    valid.resize(kTilePostCount);
    for (int j = 0; j < kTilePosts; ++j) {
      for (int i = 0; i < kTilePosts; ++i) {
        const auto k = static_cast<std::size_t>(grid.index(i, j));
        heights_m[k] = static_cast<float>(height_m(i, j));
        valid[k] = i < 128 ? 1 : 0;
      }
    }
    const HeightSteps steps = 0.0625;
    mesh = quantize(grid,
                    strip_ordered(greedy_insertion(
                        grid, heights_m, {}, {.tolerance_m = kToleranceM, .height_steps = steps})),
                    steps);
  }
  verify::TileOutside outside() const {
    return {.key = key, .mesh = mesh, .valid = valid, .tolerance_m = kToleranceM};
  }
};

TEST(FindCliff, TellsACliffAndNotARampNorWhatTheDataExplain) {
  // Posts are some 5 m apart, and 3.6 m on the parallel.
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    const int edge = 130 + static_cast<int>(random() % 100);
    const double drop_m = 20 + static_cast<double>(random() % 900);
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ": " << drop_m << " m at " << edge);
    const TileFixture cliff(kTile, [&](int i, int) { return i < edge ? drop_m : 0.0; });
    const auto found = verify::find_cliff(kGeodetic, cliff.outside(), 3);
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, FindingKind::kCliffOutside);
    EXPECT_EQ(found[0].key, kTile);
    EXPECT_TRUE(verify::find_cliff(kGeodetic, cliff.outside(), drop_m).empty());
    const TileFixture ramp(kTile,
                           [&](int i, int) { return i < 128 ? 500 : 500 - 3.0 * (i - 127); });
    EXPECT_TRUE(verify::find_cliff(kGeodetic, ramp.outside(), 3).empty());
    // A cliff in the data is the data's.
    const TileFixture inside(kTile, [&](int i, int) { return i < edge / 2 ? drop_m : 0.0; });
    EXPECT_TRUE(verify::find_cliff(kGeodetic, inside.outside(), 3).empty());
  }
}

TEST(FindLevelsApart, ComparesThePostsOutsideTheDataWithTheParents) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const TileKey key = {.zoom = 14,
                         .x = 17000 + static_cast<std::int32_t>(random() % 2),
                         .y = 12000 + static_cast<std::int32_t>(random() % 2)};
    const double raised_m = 2 + static_cast<double>(random() % 50);
    const double slope = static_cast<double>(random() % 5);
    // One plane over both, in posts of the parent.
    const double i0 = key.x % 2 * 128.0;
    const double j0 = key.y % 2 * 128.0;
    const auto plane = [slope](double i, double j) { return 800 + slope * i - 0.3 * slope * j; };
    const TileFixture parent(parent_of(key), [&](int i, int j) { return plane(i, j); });
    const TileFixture same(key, [&](int i, int j) { return plane(i0 + i / 2.0, j0 + j / 2.0); });
    EXPECT_TRUE(verify::find_levels_apart(kGeodetic, same.outside(), parent.outside()).empty());
    const TileFixture apart(key, [&](int i, int j) {
      return plane(i0 + i / 2.0, j0 + j / 2.0) + (i > 200 && j > 100 ? raised_m : 0);
    });
    const auto found = verify::find_levels_apart(kGeodetic, apart.outside(), parent.outside());
    ASSERT_EQ(found.size(), 1U);
    EXPECT_EQ(found[0].kind, FindingKind::kLevelsApartOutside);
    // Where there are data they may differ: the parent has means.
    const TileFixture in_data(key, [&](int i, int j) {
      return plane(i0 + i / 2.0, j0 + j / 2.0) + (i < 100 ? raised_m : 0);
    });
    EXPECT_TRUE(verify::find_levels_apart(kGeodetic, in_data.outside(), parent.outside()).empty());
  }
}

}  // namespace
}  // namespace qmpipe::testing::outside_test
