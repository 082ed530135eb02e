// The chords of free sides stay near the globe, with every method: a client's skirts are no deeper than a
// zoom's error.
#include <gtest/gtest.h>

#include <cmath>

#include "pipeline/recipe/method.h"
#include "stages/surface/curvature.h"
#include "stages/surface/geodesy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::testing::side_depth_test {
namespace {

// How deep the middle of a chord between two posts of the ellipsoid lies below it.
double chord_depth_m(const PostGrid& grid, Post a, Post b) {
  const auto at = [](std::int32_t k) { return static_cast<std::size_t>(k); };
  const auto place = [&](Post p) {
    return to_ecef({.longitude_deg = grid.longitude_deg[at(p.i)],
                    .latitude_deg = grid.latitude_deg[at(p.j)],
                    .height_m = 0});
  };
  return -to_geodetic(scaled(plus(place(a), place(b)), 0.5)).height_m;
}

double deepest_chord_m(const PostGrid& grid, const Tin& tin, Side side) {
  const BorderMask border = border_of(tin, side);
  double deepest_m = 0;
  std::int32_t last = 0;
  for (std::int32_t k = 1; k <= kTileIntervals; ++k) {
    if (!border.test(k)) continue;
    deepest_m = std::max(deepest_m, chord_depth_m(grid, side_post(side, last), side_post(side, k)));
    last = k;
  }
  return deepest_m;
}

TEST(SideDepth, NoMethodLetsAChordOfAFreeSideSinkTooDeep) {
  for (std::uint64_t seed = 1; seed <= 36; ++seed) {
    std::mt19937_64 random(seed);
    const TilingScheme scheme(seed % 2 == 0 ? Projection::kGeodetic : Projection::kMercator);
    const auto zoom = 1 + static_cast<std::int32_t>(random() % 9);
    const auto below = [&random](std::int32_t end) {
      return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
    };
    const TileKey key = {
        .zoom = zoom, .x = below(scheme.columns(zoom)), .y = below(scheme.rows(zoom))};
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ": " << to_string(key));
    const PostGrid grid = make_tile_grid(scheme, key);
    const std::vector<float> heights_m(kTilePostCount, static_cast<float>(below(3000)));
    const double tolerance_m = std::ldexp(15000.0, -zoom);
    // The side that is fixed is another tile's.
    FixedBorders fixed;
    const Side inherited = kSides.at(random() % 4);
    fixed[index_of(inherited)].emplace();
    fixed[index_of(inherited)]->set(0);
    fixed[index_of(inherited)]->set(kTileIntervals);
    for (const Method method : {Method::kGreedy, Method::kEdgeCollapse, Method::kPsRandom}) {
      MethodParameters parameters;
      ParameterValues values = values_at(parameters, method, Stop::kTolerance, zoom);
      values["g_e"] = tolerance_m;
      const MethodOptions options =
          method_options(method, Stop::kTolerance, values,
                         {.height_steps = std::ldexp(1.0, std::ilogb(tolerance_m / 16)),
                          .side_depth_m = tolerance_m / 4,
                          .seed = seed});
      const Tin tin = simplify(grid, heights_m, fixed, options);
      for (const Side side : kSides) {
        if (side == inherited) {
          EXPECT_EQ(border_of(tin, side), *fixed[index_of(side)]);
        } else {
          // The sphere's formula, and the longer way round the ellipsoid.
          EXPECT_LE(deepest_chord_m(grid, tin, side), 1.02 * tolerance_m / 4)
              << name_of(method) << " " << name_of(side);
        }
      }
    }
  }
}

TEST(SideDepth, FewPostsDoWhereTheGlobeIsFlat) {
  const TilingScheme scheme(Projection::kGeodetic);
  const PostGrid deep = make_tile_grid(scheme, {14, 9000, 9000});
  const PostGrid root = make_tile_grid(scheme, {0, 0, 0});
  for (const Side side : kSides) {
    EXPECT_EQ(side_stride_posts(deep, side, 0.25), kTileIntervals);
    // All posts of a pole row are one place.
    const bool is_pole = side == Side::kSouth || side == Side::kNorth;
    EXPECT_EQ(side_stride_posts(root, side, 3750), is_pole ? kTileIntervals : 4);
    EXPECT_EQ(side_stride_posts(root, side, 0.1), is_pole ? kTileIntervals : 1);
  }
}

}  // namespace
}  // namespace qmpipe::testing::side_depth_test
