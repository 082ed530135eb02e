#include "stages/greedy/greedy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "stages/posts/height_step.h"
#include "stages/surface/geodesy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::greedy_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

GreedyOptions options_for(double tolerance_m, Curvature curvature) {
  return {.tolerance_m = tolerance_m,
          .height_steps = std::exp2(std::floor(std::log2(tolerance_m / 16))),
          .curvature = curvature};
}

void expect_right(const PostGrid& grid, const std::vector<float>& heights_m,
                  const FixedBorders& fixed, const GreedyOptions& options) {
  const Tin tin = greedy_insertion(grid, heights_m, fixed, options);
  ASSERT_EQ(fault_of(grid, tin), "");
  for (const Side side : kSides) {
    if (fixed[index_of(side)]) {
      ASSERT_EQ(border_of(tin, side), *fixed[index_of(side)]) << name_of(side);
    }
  }
  ASSERT_LE(largest_error_m(grid, tin, heights_m, fixed), options.tolerance_m);
}

class GreedyOnTerrain : public ::testing::TestWithParam<Terrain> {};

TEST_P(GreedyOnTerrain, KeepsEveryPostWithinToleranceAndFixedSidesExactly) {
  for (unsigned sides = 0; sides < 16; ++sides) {
    const std::uint64_t seed = sides + 100;
    SCOPED_TRACE(std::string(name_of(GetParam())) + ", seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto heights_m = random_terrain(GetParam(), random);
    const FixedBorders fixed = random_borders(random, sides);
    constexpr std::array kTolerances = {1.0, 4.0, 30.0, 200.0};
    // A tile of zoom 9 counts curvature for the small tolerances only.
    const PostGrid grid = make_tile_grid(kGeodetic, {9, 300, 411});
    GreedyOptions options = options_for(kTolerances[sides % 4], Curvature::kCounts);
    if (GetParam() == Terrain::kNoise) options = options_for(40, Curvature::kCounts);
    expect_right(grid, heights_m, fixed, options);
  }
}

TEST_P(GreedyOnTerrain, HoldsItsPromisesInTheMercatorSchemeToo) {
  for (std::int32_t zoom = 0; zoom <= 3; ++zoom) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      SCOPED_TRACE(std::string(name_of(GetParam())) + ", zoom " + std::to_string(zoom) + ", seed " +
                   std::to_string(seed));
      std::mt19937_64 random(seed);
      const auto heights_m = random_terrain(GetParam(), random);
      const auto rows = static_cast<std::uint64_t>(kMercator.rows(zoom));
      const TileKey key = {zoom, 0, static_cast<std::int32_t>(random() % rows)};
      const FixedBorders fixed = random_borders(random, static_cast<unsigned>(random() % 16));
      expect_right(make_tile_grid(kMercator, key), heights_m, fixed,
                   options_for(50, Curvature::kIgnored));
    }
  }
}

TEST_P(GreedyOnTerrain, IsDeterministicAndCoarserWithALargerTolerance) {
  std::mt19937_64 random(17);
  const auto heights_m = random_terrain(GetParam(), random);
  const PostGrid grid = make_tile_grid(kGeodetic, {11, 1200, 800});
  std::size_t before = kTilePostCount + 1;
  for (const double tolerance_m : {2.0, 20.0, 200.0, 20000.0}) {
    const GreedyOptions options = options_for(tolerance_m, Curvature::kCounts);
    const Tin tin = greedy_insertion(grid, heights_m, {}, options);
    const Tin again = greedy_insertion(grid, heights_m, {}, options);
    ASSERT_EQ(tin.vertices, again.vertices);
    ASSERT_EQ(tin.indices, again.indices);
    ASSERT_LE(tin.vertices.size(), before);
    before = tin.vertices.size();
  }
  EXPECT_EQ(before, 4U);
}

INSTANTIATE_TEST_SUITE_P(All, GreedyOnTerrain, ::testing::ValuesIn(kTerrains),
                         [](const auto& terrain) {
                           std::string name = name_of(terrain.param);
                           name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
                           return name;
                         });

// Thin triangles along cliffs are where the rounding of a post's place matters most: a post may be
// the worst of a triangle that its vertex does not divide.
TEST(Greedy, NoPostIsForgottenWhereRoundingMovesVerticesAcrossEdges) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      auto heights_m = random_terrain(Terrain::kCliffs, random);
      for (float& h : heights_m) h += random() % 40 == 0 ? 2000.0F : 0.0F;
      expect_right(make_tile_grid(scheme, {3, 2, 5}), heights_m, {},
                   options_for(8 + static_cast<double>(seed), Curvature::kIgnored));
    }
  }
}

TEST(Greedy, OwnerAndHeirTogetherKeepPostsOfTheirSideWithinTolerance) {
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto west_m = random_terrain(Terrain::kRidges, random);
    auto east_m = random_terrain(Terrain::kCliffs, random);
    for (std::int32_t j = 0; j < kTilePosts; ++j) {
      east_m[static_cast<std::size_t>(tile_post_index(0, j))] =
          west_m[static_cast<std::size_t>(tile_post_index(256, j))];
    }
    const GreedyOptions options = options_for(10, Curvature::kCounts);
    const Tin owner = greedy_insertion(make_tile_grid(kGeodetic, {6, 4, 20}), west_m, {}, options);
    FixedBorders fixed;
    fixed[index_of(Side::kWest)] = border_of(owner, Side::kEast);
    const PostGrid grid = make_tile_grid(kGeodetic, {6, 5, 20});
    const Tin heir = greedy_insertion(grid, east_m, fixed, options);
    EXPECT_EQ(border_of(heir, Side::kWest), border_of(owner, Side::kEast));
    // No post excused: the owner has kept the side's posts.
    EXPECT_LE(largest_error_m(grid, heir, east_m, {}), options.tolerance_m);
  }
}

TEST(Greedy, AFlatTileOfADeepZoomIsTwoTriangles) {
  const std::vector<float> heights_m(kTilePostCount, 123.4F);
  const PostGrid grid = make_tile_grid(kGeodetic, {14, 9000, 5000});
  const Tin tin = greedy_insertion(grid, heights_m, {}, options_for(1, Curvature::kCounts));
  EXPECT_EQ(tin.vertices.size(), 4U);
  EXPECT_EQ(tin.triangle_count(), 2U);
}

TEST(Greedy, TheInitialGridIsThereBesideFixedSides) {
  const std::vector<float> heights_m(kTilePostCount, 0.0F);
  const PostGrid grid = make_tile_grid(kGeodetic, {14, 9000, 5000});
  for (const std::int32_t cells : {1, 3, 8, 16, 100, 256}) {
    GreedyOptions options = options_for(1, Curvature::kCounts);
    options.initial_grid_cells = cells;
    FixedBorders fixed;
    fixed[index_of(Side::kWest)].emplace().set(0);
    fixed[index_of(Side::kWest)]->set(256);
    const Tin tin = greedy_insertion(grid, heights_m, fixed, options);
    ASSERT_EQ(fault_of(grid, tin), "");
    ASSERT_EQ(border_of(tin, Side::kWest), *fixed[index_of(Side::kWest)]);
    ASSERT_EQ(border_of(tin, Side::kEast).count(), cells + 1);
    // Every grid post but those between the corners of the fixed side, and nothing else.
    ASSERT_EQ(tin.vertices.size(),
              static_cast<std::size_t>((cells + 1) * (cells + 1) - (cells - 1)));
    const std::int32_t step = kTileIntervals / cells;
    for (const TinVertex& vertex : tin.vertices) {
      ASSERT_TRUE(cells == 3 || cells == 100 ||
                  (grid.column(vertex.post) % step == 0 && grid.row(vertex.post) % step == 0));
    }
  }
}

TEST(Greedy, TiesGoToTheLowestPost) {
  std::vector<float> heights_m(kTilePostCount, 0.0F);
  // Far from the diagonal and symmetric, so that the errors are equal.
  const std::array<std::int32_t, 3> spikes = {tile_post_index(40, 200), tile_post_index(200, 40),
                                              tile_post_index(60, 200)};
  for (const std::int32_t post : spikes) heights_m[static_cast<std::size_t>(post)] = 100;
  const PostGrid grid = make_tile_grid(kGeodetic, {14, 9000, 5000});
  const Tin tin = greedy_insertion(grid, heights_m, {}, options_for(40, Curvature::kIgnored));
  ASSERT_GE(tin.vertices.size(), 5U);
  EXPECT_EQ(tin.vertices[4].post, *std::min_element(spikes.begin(), spikes.end()));
}

// How far a triangle's plane lies from a post along the post's vertical, in true ECEF.
double chord_error_m(const std::array<Vec3, 3>& corners, const Vec3& post, const Vec3& up) {
  const Vec3 normal = cross(minus(corners[1], corners[0]), minus(corners[2], corners[0]));
  return dot(normal, minus(corners[0], post)) / dot(normal, up);
}

double largest_chord_error_m(const PostGrid& grid, const Tin& tin,
                             const std::vector<float>& heights_m) {
  const auto corners = corners_of(tin);
  const double width_deg = grid.longitude_deg.back() - grid.longitude_deg.front();
  const double height_deg = grid.latitude_deg.back() - grid.latitude_deg.front();
  std::vector<Vec3> positions;
  for (std::size_t k = 0; k < corners.size(); ++k) {
    positions.push_back(to_ecef({grid.longitude_deg[0] + corners[k][0] / 32767 * width_deg,
                                 grid.latitude_deg[0] + corners[k][1] / 32767 * height_deg,
                                 tin.vertices[k].height_m}));
  }
  const auto places = locate_posts_slowly(grid, corners, tin.indices);
  std::vector<bool> judged(kTilePostCount, true);
  for (const TinVertex& vertex : tin.vertices)
    judged[static_cast<std::size_t>(vertex.post)] = false;
  double largest = 0;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    const double lon_deg = grid.longitude_deg[k % kTilePosts];
    const double lat_deg = grid.latitude_deg[k / kTilePosts];
    if (!judged[k] || std::abs(lat_deg) > 80) continue;
    const std::uint32_t* t = &tin.indices[3 * places[k].triangle];
    const Vec3 post = to_ecef({lon_deg, lat_deg, static_cast<double>(heights_m[k])});
    largest = std::max(
        largest, std::abs(chord_error_m({positions[t[0]], positions[t[1]], positions[t[2]]}, post,
                                        up_at(lon_deg, lat_deg))));
  }
  return largest;
}

TEST(Greedy, ChordsStayWithinToleranceOfTheTrueGlobe) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::int32_t zoom = 0; zoom <= 5; ++zoom) {
      for (std::uint64_t seed = 1; seed <= 4; ++seed) {
        std::mt19937_64 random(seed + 10 * static_cast<std::uint64_t>(zoom));
        const auto rows = static_cast<std::uint64_t>(scheme.rows(zoom));
        const TileKey key = {zoom, 0, static_cast<std::int32_t>(random() % rows)};
        const Terrain terrain = seed % 2 == 0 ? Terrain::kAllEqual : Terrain::kHills;
        SCOPED_TRACE(to_string(key) + ", seed " + std::to_string(seed));
        const auto heights_m = random_terrain(terrain, random);
        const PostGrid grid = make_tile_grid(scheme, key);
        const double tolerance_m = (seed < 4 ? 4000.0 : 600.0) / (1 << zoom);
        const GreedyOptions options = options_for(tolerance_m, Curvature::kCounts);
        const Tin tin = greedy_insertion(grid, heights_m, {}, options);
        ASSERT_EQ(fault_of(grid, tin), "");
        EXPECT_LE(largest_chord_error_m(grid, tin, heights_m), 1.1 * tolerance_m);
        EXPECT_LE(largest_error_m(grid, tin, heights_m, {}), tolerance_m);
      }
    }
  }
}

}  // namespace
}  // namespace qmpipe::greedy_test
