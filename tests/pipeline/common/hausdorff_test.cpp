#include "pipeline/common/hausdorff.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <random>
#include <vector>

#include "pipeline/common/nearest_grid.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/quantize.h"
#include "stages/greedy/greedy.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::testing::hausdorff_test {
namespace {

const TilingScheme kScheme(Projection::kGeodetic);
constexpr TileKey kKey = {.zoom = 9, .x = 530, .y = 390};
// A post spacing of zoom 9 on the ground.
constexpr double kSpacingM = 111320.0 * 180 / 512 / 256;

QuantizedMesh mesh_of(const std::vector<float>& heights_m, double tolerance_m) {
  const PostGrid grid = make_tile_grid(kScheme, kKey);
  const Tin tin = strip_ordered(greedy_insertion(
      grid, heights_m, {},
      {.tolerance_m = tolerance_m, .height_steps = tolerance_m / 64, .initial_grid_cells = 16}));
  return quantize(grid, tin, tolerance_m / 64);
}

std::vector<float> hills(double roughness_m) {
  std::vector<float> heights_m;
  for (std::int32_t k = 0; k < static_cast<std::int32_t>(kTilePostCount); ++k) {
    heights_m.push_back(static_cast<float>(500 + roughness_m * std::sin(k % kTilePosts * 0.11) *
                                                     std::cos(k / kTilePosts * 0.07)));
  }
  return heights_m;
}

double slow_hausdorff_m(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  const auto directed = [](const std::vector<Vec3>& from, const std::vector<Vec3>& to) {
    double largest = 0;
    for (const Vec3& p : from) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const Vec3& q : to) nearest = std::min(nearest, length(minus(p, q)));
      largest = std::max(largest, nearest);
    }
    return largest;
  };
  return std::max(directed(a, b), directed(b, a));
}

std::vector<Vec3> random_points(std::mt19937_64& random, std::size_t count, const Vec3& spread) {
  std::uniform_real_distribution<double> uniform(-1, 1);
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < count; ++k) {
    points.push_back({4e6 + spread[0] * uniform(random), 1e6 + spread[1] * uniform(random),
                      4.8e6 + spread[2] * uniform(random)});
  }
  return points;
}

TEST(Hausdorff, AgreesWithTryingEveryPair) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    std::mt19937_64 random(seed);
    // Flat, narrow, and single points too.
    const Vec3 spread = {std::pow(10.0, static_cast<double>(random() % 5)), 100,
                         random() % 3 == 0 ? 0.0 : 1000.0};
    const auto a = random_points(random, 1 + random() % 300, spread);
    const auto b = random_points(random, 1 + random() % 300, spread);
    EXPECT_NEAR(hausdorff_between_points_m(a, b), slow_hausdorff_m(a, b), 1e-6) << "seed " << seed;
    EXPECT_NEAR(hausdorff_between_points_m(a, b), hausdorff_between_points_m(b, a), 1e-6)
        << "seed " << seed;
  }
}

TEST(Hausdorff, IsZeroBetweenEqualSets) {
  std::mt19937_64 random(7);
  const auto points = random_points(random, 500, {1000, 1000, 1000});
  EXPECT_EQ(hausdorff_between_points_m(points, points), 0);
}

TEST(Hausdorff, MeasuresTheDistanceToATriangle) {
  const Triangle triangle = {Vec3{0, 0, 0}, Vec3{4, 0, 0}, Vec3{0, 4, 0}};
  EXPECT_DOUBLE_EQ(squared_distance({1, 1, 3}, triangle), 9);
  EXPECT_DOUBLE_EQ(squared_distance({1, -2, 0}, triangle), 4);
  EXPECT_DOUBLE_EQ(squared_distance({4, 4, 0}, triangle), 8);
  EXPECT_DOUBLE_EQ(squared_distance({-3, -4, 0}, triangle), 25);
  EXPECT_DOUBLE_EQ(squared_distance({2, 3, 0}, {Vec3{0, 0, 0}, Vec3{4, 0, 0}, Vec3{2, 0, 0}}), 9);
  EXPECT_DOUBLE_EQ(squared_distance({0, 0, 2}, {Vec3{}, Vec3{}, Vec3{}}), 4);
}

TEST(Hausdorff, FindsTheNearestOfManyTriangles) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    std::mt19937_64 random(seed);
    const auto asked = random_points(random, 50, {1000, 1000, 1000});
    std::vector<Triangle> triangles;
    for (std::size_t k = 0; k < 1 + random() % 200; ++k) {
      // Slivers across the whole set among small ones.
      const auto corners = random_points(random, 3, {1000, 1000, 1000});
      const double size = random() % 4 == 0 ? 1 : 0.05;
      triangles.push_back({corners[0],
                           plus(corners[0], scaled(minus(corners[1], corners[0]), size)),
                           plus(corners[0], scaled(minus(corners[2], corners[0]), size))});
    }
    const NearestGrid<Triangle> grid(triangles, asked);
    for (const Vec3& p : asked) {
      double nearest = std::numeric_limits<double>::infinity();
      for (const Triangle& t : triangles) nearest = std::min(nearest, squared_distance(p, t));
      EXPECT_EQ(grid.nearest_squared(p, 0), nearest) << "seed " << seed;
    }
  }
}

TEST(Hausdorff, IsTheShiftOfAShiftedSurface) {
  std::vector<float> heights_m = hills(50);
  const QuantizedMesh mesh = mesh_of(heights_m, 1);
  for (float& h : heights_m) h += 20000;
  const HausdorffDistances distances = tile_hausdorff(kScheme, kKey, mesh, heights_m);
  // Hills and the globe's widening upwards add a little at the sides; gaps between points more.
  EXPECT_NEAR(distances.to_surfaces_m, 20000, 60);
  EXPECT_GT(distances.between_points_m, distances.to_surfaces_m - 1e-6);
}

TEST(Hausdorff, ToTheSurfaceIsAboutTheVerticalError) {
  const std::vector<float> heights_m = hills(50);
  for (const double tolerance_m : {16.0, 4.0, 1.0}) {
    const double distance_m =
        tile_hausdorff(kScheme, kKey, mesh_of(heights_m, tolerance_m), heights_m).to_surfaces_m;
    // A vertex stands up to half a quantized unit, 0.6 m here, beside its post; a chord of a parallel
    // runs 0.2 m beside it.
    EXPECT_LT(distance_m, tolerance_m + 0.8);
    EXPECT_GT(distance_m, tolerance_m * 0.5);
  }
}

TEST(Hausdorff, BetweenPointsIsBoundedByTheGapsOfTheSampling) {
  const std::vector<float> heights_m = hills(50);
  const double coarse_m =
      tile_hausdorff(kScheme, kKey, mesh_of(heights_m, 8), heights_m).between_points_m;
  const double fine_m =
      tile_hausdorff(kScheme, kKey, mesh_of(heights_m, 0.5), heights_m).between_points_m;
  EXPECT_LT(fine_m, 12 * kSpacingM);
  EXPECT_LT(fine_m, coarse_m);
}

TEST(Hausdorff, IsTheSameEveryTime) {
  const std::vector<float> heights_m = hills(50);
  const QuantizedMesh mesh = mesh_of(heights_m, 4);
  const HausdorffDistances once = tile_hausdorff(kScheme, kKey, mesh, heights_m);
  const HausdorffDistances again = tile_hausdorff(kScheme, kKey, mesh, heights_m);
  EXPECT_EQ(once.to_surfaces_m, again.to_surfaces_m);
  EXPECT_EQ(once.between_points_m, again.between_points_m);
}

}  // namespace
}  // namespace qmpipe::testing::hausdorff_test
