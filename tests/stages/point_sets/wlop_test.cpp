#include "stages/point_sets/wlop.h"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/wlop_simplify_and_regularize_point_set.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
#include <random>

#include "stages/point_sets/point_cells.h"

namespace qmpipe::wlop_test {
namespace {

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

std::vector<Vec3> random_points(std::size_t count, std::mt19937_64& random) {
  std::vector<Vec3> points;
  for (std::size_t k = 0; k < count; ++k) {
    const double x = uniform(random, 0, 1000);
    const double y = uniform(random, 0, 1000);
    points.push_back({x, y, 50 * std::sin(x / 100) + 20 * uniform(random, 0, 1)});
  }
  return points;
}

TEST(PointCells, FindsWhatAFullSearchFinds) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto points = random_points(random() % 800, random);
    // From one that makes each point a cell of its own to one that puts all into one.
    const double radius_m = std::pow(10.0, uniform(random, -6, 4));
    const PointCells cells(points, radius_m);
    for (int k = 0; k < 50; ++k) {
      Vec3 centre = {uniform(random, -2e3, 3e3), uniform(random, -2e3, 3e3),
                     uniform(random, -99, 99)};
      if (k % 2 == 0 && !points.empty()) centre = points[random() % points.size()];
      std::map<std::uint32_t, double> found;
      cells.for_each_near(centre, [&](std::uint32_t index, double squared_m) {
        EXPECT_TRUE(found.emplace(index, squared_m).second);
      });
      std::map<std::uint32_t, double> expected;
      for (std::uint32_t index = 0; index < points.size(); ++index) {
        const Vec3 d = minus(points[index], centre);
        if (dot(d, d) <= radius_m * radius_m) expected[index] = dot(d, d);
      }
      ASSERT_EQ(found, expected);
    }
  }
}

TEST(Wlop, IsCgalsOnAPlane) {
  using CgalPoint = CGAL::Simple_cartesian<double>::Point_3;
  const PostGrid grid = make_plane_grid(11, 11, 100, 100);
  const MetricFrame frame(grid);
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double radius_m = std::pow(10.0, uniform(random, 0.5, 2.3));
    std::vector<CgalPoint> others;
    for (const Vec3& p : random_points(1500, random)) others.emplace_back(p[0], p[1], p[2]);
    std::vector<CgalPoint> expected;
    // Shuffles the points; the last are the sample.
    CGAL::wlop_simplify_and_regularize_point_set<CGAL::Sequential_tag>(
        others, std::back_inserter(expected),
        CGAL::parameters::select_percentage(25).neighbor_radius(radius_m).number_of_iterations(5));
    std::vector<SurfacePoint> points;
    for (const CgalPoint& p : others) {
      points.push_back({.position = {p.x(), p.y(), p.z()}, .height_m = p.z()});
    }
    std::vector<std::uint32_t> sample(expected.size());
    std::iota(sample.begin(), sample.end(),
              static_cast<std::uint32_t>(points.size() - expected.size()));
    const auto moved =
        wlop(points, sample, frame, {.neighbour_radius_m = radius_m, .iterations = 5});
    ASSERT_EQ(moved.size(), expected.size());
    for (std::size_t k = 0; k < moved.size(); ++k) {
      ASSERT_NEAR(moved[k].position[0], expected[k].x(), 1e-7);
      ASSERT_NEAR(moved[k].position[1], expected[k].y(), 1e-7);
      ASSERT_NEAR(moved[k].position[2], expected[k].z(), 1e-7);
      ASSERT_NEAR(moved[k].height_m, expected[k].z(), 1e-7);
    }
  }
}

// All posts of a tile inside its sides, as points.
std::vector<SurfacePoint> points_of(const PostGrid& grid, const MetricFrame& frame,
                                    double height_m) {
  std::vector<SurfacePoint> points;
  for (std::int32_t j = 1; j < kTileIntervals; ++j) {
    for (std::int32_t i = 1; i < kTileIntervals; ++i) {
      points.push_back(
          {.position = frame.position(grid.index(i, j), height_m), .height_m = height_m});
    }
  }
  return points;
}

TEST(Wlop, PointsOnALevelGlobeStayLevel) {
  for (const std::int32_t zoom : {0, 2, 5, 10}) {
    SCOPED_TRACE("zoom " + std::to_string(zoom));
    const PostGrid grid = make_tile_grid(TilingScheme(Projection::kGeodetic), {zoom, 0, 0});
    const MetricFrame frame(grid);
    const auto points = points_of(grid, frame, 1000);
    std::vector<std::uint32_t> sample;
    for (std::uint32_t k = 0; k < points.size(); k += 37) sample.push_back(k);
    // Two and a half posts.
    const double radius_m = 2.5 * 78300.0 / (1 << zoom);
    const auto moved =
        wlop(points, sample, frame, {.neighbour_radius_m = radius_m, .iterations = 5});
    double farthest_m = 0;
    for (std::size_t k = 0; k < moved.size(); ++k) {
      EXPECT_NEAR(moved[k].height_m, 1000, 1e-6);
      EXPECT_NEAR(to_geodetic(moved[k].position).height_m, 1000, 1e-6);
      farthest_m =
          std::max(farthest_m, length(minus(moved[k].position, points[sample[k]].position)));
    }
    EXPECT_GT(farthest_m, radius_m / 10);
  }
}

TEST(Wlop, PointsWithoutNeighboursDoNotMoveByABit) {
  const PostGrid grid = make_tile_grid(TilingScheme(Projection::kGeodetic), {10, 300, 400});
  const MetricFrame frame(grid);
  const auto points = points_of(grid, frame, 123.4);
  std::vector<std::uint32_t> sample;
  for (std::uint32_t k = 0; k < points.size(); k += 100) sample.push_back(k);
  const auto moved = wlop(points, sample, frame, {.neighbour_radius_m = 5, .iterations = 3});
  for (std::size_t k = 0; k < moved.size(); ++k) ASSERT_EQ(moved[k], points[sample[k]]);
}

}  // namespace
}  // namespace qmpipe::wlop_test
