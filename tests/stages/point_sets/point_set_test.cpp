#include "stages/point_sets/point_set.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <thread>

#include "stages/posts/height_step.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::point_set_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

constexpr std::array kMethods = {PointSetMethod::kRandom, PointSetMethod::kGrid,
                                 PointSetMethod::kHierarchy, PointSetMethod::kWlop};
const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

// The metres between two posts of a tile at the equator.
double spacing_m(const TileKey& key) { return 78271.5 / (1 << key.zoom); }

// The paper's values of zoom 10, made to fit the zoom where they are lengths.
PointSetOptions options_for(const TileKey& key, PointSetMethod method) {
  return {.method = method,
          .height_steps = 0.25,
          .seed = 7,
          .polyline_error_m = spacing_m(key) / 76,
          .least_polyline_points = 8,
          .cell_size_m = 6.4 * spacing_m(key),
          .neighbour_radius_m = 1.7 * spacing_m(key),
          .iterations = 3};
}

void expect_right(const PostGrid& grid, const std::vector<float>& heights_m,
                  const FixedBorders& fixed, const PointSetOptions& options, const Tin& tin) {
  ASSERT_EQ(fault_of(grid, tin), "");
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  for (const TinVertex& vertex : tin.vertices) {
    ASSERT_EQ(vertex.height_m, snapped_height(vertex.height_m, options.height_steps.inner_m));
    ASSERT_GE(vertex.height_m, static_cast<double>(*low) - options.height_steps.inner_m / 2);
    ASSERT_LE(vertex.height_m, static_cast<double>(*high) + options.height_steps.inner_m / 2);
    if (vertex.post == kNoPost) {
      ASSERT_EQ(options.method, PointSetMethod::kWlop);
    } else {
      const float height_m = heights_m[static_cast<std::size_t>(vertex.post)];
      ASSERT_EQ(vertex, vertex_at_post(grid, vertex.post, height_m, options.height_steps));
    }
  }
  for (const Side side : kSides) {
    if (!fixed[index_of(side)]) continue;
    ASSERT_EQ(border_of(tin, side), *fixed[index_of(side)]);
  }
}

// The longest edge of a side as a share of it, in per cent.
double longest_percent(const PostGrid& grid, const Tin& tin, Side side) {
  const bool is_vertical = side == Side::kWest || side == Side::kEast;
  std::vector<std::int32_t> along;
  for (const TinVertex& vertex : tin.vertices) {
    const bool on_side = (side == Side::kWest && vertex.u == 0) ||
                         (side == Side::kSouth && vertex.v == 0) ||
                         (side == Side::kEast && vertex.u == grid.u_max()) ||
                         (side == Side::kNorth && vertex.v == grid.v_max());
    if (on_side) along.push_back(is_vertical ? vertex.v : vertex.u);
  }
  std::sort(along.begin(), along.end());
  std::int32_t longest = 0;
  for (std::size_t k = 1; k < along.size(); ++k)
    longest = std::max(longest, along[k] - along[k - 1]);
  return 100.0 * longest / (is_vertical ? grid.v_max() : grid.u_max());
}

class PointSetOnTerrain : public ::testing::TestWithParam<Terrain> {};

TEST_P(PointSetOnTerrain, KeepsItsPromisesWithAllMethodsAndFixedSides) {
  constexpr std::array kKeys = {TileKey{0, 0, 0}, TileKey{1, 3, 1}, TileKey{2, 5, 3},
                                TileKey{5, 9, 9}, TileKey{10, 900, 700}};
  for (unsigned sides = 0; sides < 16; ++sides) {
    for (std::size_t m = 0; m < kMethods.size(); ++m) {
      const std::uint64_t seed = 16 * m + sides + 1;
      const TileKey key = kKeys[seed % kKeys.size()];
      const bool is_mercator = seed % 3 == 0 && key.zoom != 1;
      SCOPED_TRACE(to_string(key) + (is_mercator ? " mercator" : "") + ", method " +
                   std::to_string(m) + ", seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const auto heights_m = random_terrain(GetParam(), random);
      const FixedBorders fixed = random_borders(random, sides);
      const PostGrid grid = make_tile_grid(is_mercator ? kMercator : kGeodetic, key);
      PointSetOptions options = options_for(key, kMethods[m]);
      options.longest_border_edge_percent = seed % 2 == 0 ? 10 : 2.5;
      const Tin tin = simplify_point_set(grid, heights_m, fixed, options);
      ASSERT_NO_FATAL_FAILURE(expect_right(grid, heights_m, fixed, options, tin));
      for (const Side side : kSides) {
        if (fixed[index_of(side)]) continue;
        ASSERT_LE(longest_percent(grid, tin, side), options.longest_border_edge_percent);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, PointSetOnTerrain, ::testing::ValuesIn(kTerrains),
                         [](const auto& terrain) {
                           std::string name = name_of(terrain.param);
                           name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
                           return name;
                         });

TEST(PointSet, IsTheSameInTwoThreadsAtOnce) {
  std::mt19937_64 random(3);
  const auto heights_m = random_terrain(Terrain::kRidges, random);
  const TileKey key = {10, 900, 700};
  const PostGrid grid = make_tile_grid(kGeodetic, key);
  for (const PointSetMethod method : kMethods) {
    const PointSetOptions options = options_for(key, method);
    const Tin expected = simplify_point_set(grid, heights_m, {}, options);
    std::array<Tin, 2> tins;
    {
      std::vector<std::jthread> threads;
      for (Tin& tin : tins) {
        threads.emplace_back([&] { tin = simplify_point_set(grid, heights_m, {}, options); });
      }
    }
    for (const Tin& tin : tins) {
      EXPECT_EQ(tin.vertices, expected.vertices);
      EXPECT_EQ(tin.indices, expected.indices);
    }
  }
}

TEST(PointSet, AnotherSeedChoosesOthersWhereChanceChooses) {
  std::mt19937_64 random(4);
  const auto heights_m = random_terrain(Terrain::kHills, random);
  const TileKey key = {10, 900, 700};
  const PostGrid grid = make_tile_grid(kGeodetic, key);
  for (const PointSetMethod method : kMethods) {
    PointSetOptions options = options_for(key, method);
    const Tin first = simplify_point_set(grid, heights_m, {}, options);
    options.seed = 8;
    const Tin second = simplify_point_set(grid, heights_m, {}, options);
    EXPECT_EQ(first.vertices == second.vertices, method == PointSetMethod::kHierarchy);
    for (const Side side : kSides) EXPECT_EQ(border_of(first, side), border_of(second, side));
  }
}

TEST(PointSet, TheParametersOfEachMethodDecideHowMuchIsLeft) {
  std::mt19937_64 random(5);
  const auto heights_m = random_terrain(Terrain::kHills, random);
  const TileKey key = {10, 900, 700};
  const PostGrid grid = make_tile_grid(kGeodetic, key);
  const auto count = [&](PointSetOptions options) {
    options.longest_border_edge_percent = 100;
    options.polyline_error_m = 1e9;
    options.least_polyline_points = 10000;
    return simplify_point_set(grid, heights_m, {}, options).vertices.size();
  };
  constexpr std::size_t kInside = 255 * 255;
  PointSetOptions options = options_for(key, PointSetMethod::kRandom);
  options.removed_percent = 100;
  EXPECT_EQ(count(options), 4U);
  options.removed_percent = 40;
  EXPECT_EQ(count(options), 4 + kInside * 60 / 100);
  options.removed_percent = 0;
  EXPECT_EQ(count(options), 4 + kInside);
  options = options_for(key, PointSetMethod::kWlop);
  options.neighbour_radius_m = 1;
  options.retained_percent = 20;
  EXPECT_EQ(count(options), 4 + kInside / 5);
  options = options_for(key, PointSetMethod::kGrid);
  const std::size_t cells = count(options);
  options.cell_size_m *= 2;
  EXPECT_GT(cells, 2 * count(options));
  options = options_for(key, PointSetMethod::kHierarchy);
  const std::size_t clusters = count(options);
  EXPECT_GE(clusters, 4 + kInside / 50);
  options.cluster_size = 5;
  EXPECT_GT(count(options), clusters);
}

// Figure 5 of the paper: without polylines chance destroys the crest.
TEST(PointSet, ACrestSurvivesThatChanceWouldTakeAway) {
  const PostGrid grid = make_plane_grid(101, 101, 10, 10);
  std::vector<float> heights_m;
  const auto crest = [](int j) { return 50 + (j / 10 % 2 == 0 ? j % 10 : 10 - j % 10); };
  for (int j = 0; j < 101; ++j) {
    for (int i = 0; i < 101; ++i) {
      heights_m.push_back(static_cast<float>(800 - 16 * std::abs(i - crest(j))));
    }
  }
  PointSetOptions options{.height_steps = 0.25, .seed = 1, .removed_percent = 97};
  const auto lowest_on_crest_m = [&] {
    const Tin tin = simplify_point_set(grid, heights_m, {}, options);
    EXPECT_EQ(fault_of(grid, tin), "");
    int on_crest = 0;
    for (const TinVertex& vertex : tin.vertices) on_crest += vertex.height_m == 800 ? 1 : 0;
    return on_crest;
  };
  // Its turns and its ends.
  EXPECT_GE(lowest_on_crest_m(), 11);
  options.least_polyline_points = 102;
  EXPECT_LT(lowest_on_crest_m(), 9);
}

TEST(PointSet, WorksForPlanesOfAnySize) {
  for (const auto& [width, height] : {std::pair{2, 2}, {2, 9}, {3, 3}, {40, 25}, {300, 4}}) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    const PostGrid grid = make_plane_grid(width, height, 10, 20);
    std::vector<float> heights_m;
    for (std::size_t k = 0; k < grid.post_count(); ++k) {
      heights_m.push_back(static_cast<float>(k * k % 97));
    }
    for (const PointSetMethod method : kMethods) {
      PointSetOptions options{.method = method, .height_steps = 0.5};
      options.cell_size_m = 35;
      options.neighbour_radius_m = 45;
      const Tin tin = simplify_point_set(grid, heights_m, {}, options);
      ASSERT_NO_FATAL_FAILURE(expect_right(grid, heights_m, {}, options, tin));
    }
  }
}

// A post in a corner widens the range that heights are clamped to; no corner is in the point set.
TEST(PointSet, WlopDoesNotSinkIntoTheGlobe) {
  std::vector<float> heights_m(kTilePostCount, 1000);
  heights_m.front() = -9000;
  heights_m.back() = 9000;
  for (const TileKey& key :
       {TileKey{0, 0, 0}, TileKey{1, 0, 1}, TileKey{2, 3, 1}, TileKey{6, 60, 2}}) {
    SCOPED_TRACE(to_string(key));
    const PostGrid grid = make_tile_grid(kGeodetic, key);
    PointSetOptions options = options_for(key, PointSetMethod::kWlop);
    options.neighbour_radius_m *= 2;
    const Tin tin = simplify_point_set(grid, heights_m, {}, options);
    EXPECT_EQ(fault_of(grid, tin), "");
    std::size_t moved = 0;
    for (const TinVertex& vertex : tin.vertices) {
      if (vertex.post == kNoPost) ++moved;
      if (vertex.u > 0 && vertex.v > 0 && vertex.u < grid.u_max() && vertex.v < grid.v_max()) {
        ASSERT_EQ(vertex.height_m, 1000);
      }
    }
    EXPECT_GT(moved, 5000U);
  }
}

}  // namespace
}  // namespace qmpipe::point_set_test
