#include "stages/finish/quantize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "stages/finish/mesh_order.h"
#include "stages/greedy/greedy.h"
#include "stages/posts/height_step.h"
#include "stages/surface/geodesy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::quantize_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

RectangleDeg rectangle_of(const PostGrid& grid) {
  return {grid.longitude_deg.front(), grid.latitude_deg.front(), grid.longitude_deg.back(),
          grid.latitude_deg.back()};
}

struct Tile {
  PostGrid grid;
  std::vector<float> heights_m;
  Tin tin;
  QuantizedMesh mesh;
};

Tile make_tile(const TilingScheme& scheme, const TileKey& key, std::vector<float> heights_m,
               const FixedBorders& fixed, double tolerance_m, const HeightSteps& steps) {
  Tile tile;
  tile.grid = make_tile_grid(scheme, key);
  tile.heights_m = std::move(heights_m);
  tile.tin = strip_ordered(greedy_insertion(
      tile.grid, tile.heights_m, fixed,
      {.tolerance_m = tolerance_m, .height_steps = steps, .curvature = Curvature::kIgnored}));
  tile.mesh = quantize(tile.grid, tile.tin, steps);
  return tile;
}

Tile random_tile(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const TilingScheme& scheme = seed % 2 == 0 ? kGeodetic : kMercator;
  const Terrain terrain = kTerrains[seed % kTerrains.size()];
  const auto zoom = static_cast<std::int32_t>(seed % 12);
  const auto rows = static_cast<std::uint64_t>(scheme.rows(zoom));
  const TileKey key = {zoom, 0, static_cast<std::int32_t>(random() % rows)};
  const double tolerance_m = terrain == Terrain::kNoise ? 50 : 8;
  return make_tile(scheme, key, random_terrain(terrain, random), {}, tolerance_m, 0.5);
}

double ulp_m(double value) {
  const auto f = static_cast<float>(std::abs(value));
  return static_cast<double>(std::nextafter(f, 1e30F) - f);
}

bool is_never_hidden(const QuantizedMeshHeader& header) {
  const Vec3& point = header.horizon_occlusion_point;
  const double farthest = std::max({std::abs(point[0]), std::abs(point[1]), std::abs(point[2])});
  return farthest > kNeverHiddenRadii / 2;
}

TEST(Quantize, VerticesDecodeToTheirSnappedHeights) {
  for (std::uint64_t seed = 1; seed <= 32; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Tile tile = random_tile(seed);
    const double low_m = static_cast<double>(tile.mesh.header.min_height_m);
    const double high_m = static_cast<double>(tile.mesh.header.max_height_m);
    const double rounding_m = ulp_m(std::max(std::abs(low_m), std::abs(high_m))) / 2 + 1e-9;
    double lowest_m = 1e9;
    double highest_m = -1e9;
    for (std::size_t k = 0; k < tile.tin.vertices.size(); ++k) {
      const auto post = static_cast<std::size_t>(tile.tin.vertices[k].post);
      const double snapped_m = snapped_height(static_cast<double>(tile.heights_m[post]), 0.5);
      ASSERT_NEAR(decoded_height_m(tile.mesh, k), snapped_m, rounding_m);
      ASSERT_LE(tile.mesh.h[k], kQuantizedMax);
      lowest_m = std::min(lowest_m, snapped_m);
      highest_m = std::max(highest_m, snapped_m);
    }
    // The header is tight: exact below, and less than twice the range above.
    EXPECT_EQ(low_m, lowest_m);
    EXPECT_GE(high_m, highest_m - rounding_m);
    EXPECT_LE(high_m - low_m, 2 * (highest_m - lowest_m) + rounding_m);
  }
}

TEST(Quantize, PlacesAreThePostsRoundedAndSideListsCompleteAndSorted) {
  for (std::uint64_t seed = 1; seed <= 32; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Tile tile = random_tile(seed);
    std::array<std::map<std::int32_t, std::uint32_t>, 4> expected;
    for (std::uint32_t k = 0; k < tile.tin.vertices.size(); ++k) {
      const std::int32_t i = tile.tin.vertices[k].post % kTilePosts;
      const std::int32_t j = tile.tin.vertices[k].post / kTilePosts;
      ASSERT_EQ(tile.mesh.u[k], std::lround(i * 32767.0 / 256));
      ASSERT_NEAR(tile.mesh.v[k], tile.grid.v_exact[static_cast<std::size_t>(j)], 0.5);
      if (i == 0) expected[0][j] = k;
      if (j == 0) expected[1][i] = k;
      if (i == kTileIntervals) expected[2][j] = k;
      if (j == kTileIntervals) expected[3][i] = k;
    }
    for (std::size_t side = 0; side < 4; ++side) {
      std::vector<std::uint32_t> list;
      for (const auto& [place, vertex] : expected[side]) list.push_back(vertex);
      ASSERT_EQ(tile.mesh.sides[side], list);
    }
    EXPECT_EQ(tile.mesh.indices, tile.tin.indices);
  }
}

// Two neighbours of very different ranges and inner steps within the zoom: a plain and an alp; every
// third pair higher than any mountain, where the header's maximum is not exact to a millimetre.
TEST(Quantize, SharedVerticesDecodeToTheSamePlaceWithinAMillimetre) {
  for (std::uint64_t seed = 1; seed <= 48; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double step_m = std::exp2(static_cast<double>(seed % 5) - 1);
    const Side side = seed % 2 == 0 ? Side::kEast : Side::kNorth;
    const TilingScheme& scheme = seed % 4 < 2 ? kGeodetic : kMercator;
    const TileKey key = {.zoom = 5, .x = scheme.columns(5) - 1, .y = 7};
    auto here_m = random_terrain(Terrain::kHills, random);
    auto there_m = random_terrain(kTerrains[seed % kTerrains.size()], random);
    const float raised_m = seed % 3 == 0 ? 40000.0F + 1000.0F * static_cast<float>(seed) : 0.0F;
    for (float& h : there_m) h = std::clamp(h * 3, -8000.0F, 8000.0F) + raised_m;
    for (float& h : here_m) h += raised_m;
    const HeightSteps here_steps(step_m, 1 + static_cast<int>(seed % 4));
    // 16 km fit 32,767 steps of half a metre, not more.
    const HeightSteps there_steps(step_m, step_m < 1 ? 1 : 1 + static_cast<int>(seed / 4 % 2));
    for (std::int32_t k = 0; k < kTilePosts; ++k) {
      const Post a = side_post(side, k);
      const Post b = side_post(opposite(side), k);
      there_m[static_cast<std::size_t>(tile_post_index(b.i, b.j))] =
          here_m[static_cast<std::size_t>(tile_post_index(a.i, a.j))];
    }
    const Tile here = make_tile(scheme, key, here_m, {}, 16 * step_m, here_steps);
    FixedBorders fixed;
    fixed[index_of(opposite(side))] = border_of(here.tin, side);
    const Tile there = make_tile(scheme, *scheme.neighbour(key, side), there_m, fixed,
                                 std::max(100.0, 16 * step_m), there_steps);
    const auto& ours = here.mesh.sides[index_of(side)];
    const auto& theirs = there.mesh.sides[index_of(opposite(side))];
    ASSERT_EQ(ours.size(), theirs.size());
    for (std::size_t k = 0; k < ours.size(); ++k) {
      const Vec3 a = decoded_position_ecef(here.mesh, rectangle_of(here.grid), ours[k]);
      const Vec3 b = decoded_position_ecef(there.mesh, rectangle_of(there.grid), theirs[k]);
      ASSERT_LT(length(minus(a, b)), 1e-3);
    }
  }
}

TEST(Quantize, AFlatTileSaysMinimumEqualsMaximum) {
  const Tile tile = make_tile(kGeodetic, {12, 100, 100}, std::vector<float>(kTilePostCount, -37.3F),
                              {}, 1, 0.0625);
  EXPECT_EQ(tile.mesh.header.min_height_m, -37.3125F);
  EXPECT_EQ(tile.mesh.header.max_height_m, -37.3125F);
  for (const std::uint16_t h : tile.mesh.h) EXPECT_EQ(h, 0);
}

TEST(Quantize, TheWholeRangeOfStepsFits) {
  std::vector<float> heights_m(kTilePostCount, 0.0F);
  heights_m[0] = -100;
  heights_m[tile_post_index(256, 256)] = 32667;
  const Tile tile = make_tile(kGeodetic, {12, 100, 100}, heights_m, {}, 16, 1);
  EXPECT_EQ(tile.mesh.header.min_height_m, -100);
  EXPECT_EQ(tile.mesh.header.max_height_m, 32667);
  EXPECT_EQ(*std::max_element(tile.mesh.h.begin(), tile.mesh.h.end()), 32767);
}

TEST(Quantize, TheSphereHoldsEveryVertexAndTheOcclusionPointStandsOutside) {
  for (std::uint64_t seed = 1; seed <= 48; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Tile tile = random_tile(seed);
    const QuantizedMeshHeader& header = tile.mesh.header;
    for (std::size_t k = 0; k < tile.mesh.vertex_count(); ++k) {
      const Vec3 p = decoded_position_ecef(tile.mesh, rectangle_of(tile.grid), k);
      ASSERT_LE(length(minus(p, header.sphere_centre_ecef_m)), header.sphere_radius_m);
    }
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_TRUE(std::isfinite(header.centre_ecef_m[k]));
      EXPECT_TRUE(std::isfinite(header.horizon_occlusion_point[k]));
    }
    if (is_never_hidden(header)) continue;
    const double magnitude = length(header.horizon_occlusion_point);
    EXPECT_GE(magnitude, 1 - 1e-12);
    EXPECT_LE(magnitude, 1e3 * (1 + 1e-9));
    // A small tile's point hovers close above its surface.
    const double width_deg = tile.grid.longitude_deg.back() - tile.grid.longitude_deg.front();
    if (width_deg < 2) {
      EXPECT_LT(magnitude, 1.01);
    }
  }
}

// No camera has such a tile behind its horizon, and its rectangle's middle is the only direction that
// does not depend on where a sphere as large as the earth happens to stand.
TEST(Quantize, ATileHalfRoundTheGlobeIsNeverHidden) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const PostGrid grid = make_tile_grid(scheme, {0, 0, 0});
    const std::vector<float> heights_m(kTilePostCount, 0.0F);
    for (const std::int32_t cells : {0, 2, 16}) {
      const Tin tin = strip_ordered(greedy_insertion(grid, heights_m, {},
                                                     {.tolerance_m = 1e5,
                                                      .height_steps = 64,
                                                      .initial_grid_cells = cells,
                                                      .curvature = Curvature::kIgnored}));
      const QuantizedMesh mesh = quantize(grid, tin, 64);
      EXPECT_GT(mesh.header.sphere_radius_m, 1e6);
      EXPECT_TRUE(is_never_hidden(mesh.header));
    }
  }
}

std::vector<std::array<std::int32_t, 3>> triangles_by_post(const Tin& tin) {
  std::vector<std::array<std::int32_t, 3>> triangles;
  for (std::size_t t = 0; t < tin.indices.size(); t += 3) {
    std::array<std::int32_t, 3> c = {tin.vertices[tin.indices[t]].post,
                                     tin.vertices[tin.indices[t + 1]].post,
                                     tin.vertices[tin.indices[t + 2]].post};
    std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
    triangles.push_back(c);
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

TEST(MeshOrder, KeepsTheTrianglesAndNumbersVerticesByFirstUse) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const PostGrid grid = make_tile_grid(kGeodetic, {9, 3, 200});
    const auto heights_m = random_terrain(kTerrains[seed % kTerrains.size()], random);
    const Tin tin = greedy_insertion(grid, heights_m, {}, {.tolerance_m = 50, .height_steps = 2});
    const Tin ordered = strip_ordered(tin);
    ASSERT_EQ(triangles_by_post(ordered), triangles_by_post(tin));
    ASSERT_EQ(fault_of(grid, ordered), "");
    std::uint32_t next = 0;
    for (const std::uint32_t index : ordered.indices) {
      ASSERT_LE(index, next);
      if (index == next) ++next;
    }
    ASSERT_EQ(next, ordered.vertices.size());
    const Tin again = strip_ordered(tin);
    ASSERT_EQ(again.vertices, ordered.vertices);
    ASSERT_EQ(again.indices, ordered.indices);
  }
}

}  // namespace
}  // namespace qmpipe::quantize_test
