#include "stages/point_sets/point_subset.h"

#include <CGAL/Simple_cartesian.h>
#include <CGAL/grid_simplify_point_set.h>
#include <CGAL/hierarchy_simplify_point_set.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace qmpipe::point_subset_test {
namespace {

using CgalPoint = CGAL::Simple_cartesian<double>::Point_3;

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

std::vector<Vec3> random_points(std::size_t count, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<Vec3> points;
  const double rough_m = uniform(random, 0, 100);
  for (std::size_t k = 0; k < count; ++k) {
    const double x = uniform(random, -1000, 1000);
    const double y = uniform(random, -1000, 1000);
    points.push_back({x, y, 200 * std::sin(x / 300) + rough_m * uniform(random, 0, 1)});
  }
  return points;
}

std::vector<CgalPoint> cgal_points(const std::vector<Vec3>& points) {
  std::vector<CgalPoint> result;
  for (const Vec3& p : points) result.emplace_back(p[0], p[1], p[2]);
  return result;
}

TEST(RandomSubset, HasTheRightSizeAndComesFromTheSeedAlone) {
  for (const double removed_percent : {0.0, 10.0, 75.0, 99.9, 100.0}) {
    const auto kept = random_subset(1000, removed_percent, 7);
    EXPECT_EQ(kept.size(),
              static_cast<std::size_t>(std::floor(1000 * (1 - removed_percent / 100))));
    EXPECT_TRUE(std::adjacent_find(kept.begin(), kept.end(), std::greater_equal<>()) == kept.end());
    EXPECT_TRUE(kept.empty() || kept.back() < 1000);
    EXPECT_EQ(random_subset(1000, removed_percent, 7), kept);
  }
  EXPECT_NE(random_subset(1000, 75, 8), random_subset(1000, 75, 7));
  EXPECT_TRUE(random_subset(0, 75, 1).empty());
}

TEST(RandomSubset, TakesEachPointAboutAsOften) {
  std::vector<int> taken(40, 0);
  for (std::uint64_t seed = 1; seed <= 4000; ++seed) {
    for (const std::uint32_t k : random_subset(taken.size(), 75, seed)) ++taken[k];
  }
  // 1000 each; the standard deviation is 27.
  for (const int n : taken) EXPECT_NEAR(n, 1000, 150);
}

TEST(GridSubset, KeepsOnePointOfEachCell) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto points = random_points(3000, seed);
    for (const double cell_m : {1e-3, 30.0, 77.7, 500.0, 1e6}) {
      const auto kept = grid_subset(points, cell_m, seed);
      std::map<Vec3, int> cells;
      for (const Vec3& p : points) {
        cells[{std::floor(p[0] / cell_m), std::floor(p[1] / cell_m), std::floor(p[2] / cell_m)}] =
            0;
      }
      for (const std::uint32_t k : kept) {
        const Vec3& p = points[k];
        ++cells.at(
            {std::floor(p[0] / cell_m), std::floor(p[1] / cell_m), std::floor(p[2] / cell_m)});
      }
      for (const auto& [cell, count] : cells) ASSERT_EQ(count, 1);
      auto other = cgal_points(points);
      ASSERT_EQ(kept.size(), static_cast<std::size_t>(CGAL::grid_simplify_point_set(other, cell_m) -
                                                      other.begin()));
      ASSERT_EQ(grid_subset(points, cell_m, seed), kept);
    }
    EXPECT_NE(grid_subset(points, 500, seed + 1), grid_subset(points, 500, seed));
  }
}

// For CGAL, whose own solver stops at five digits: the roots of the characteristic polynomial, and
// as the largest one's vector the longest product of two rows of what is left.
struct ExactDiagonalization {
  static bool diagonalize_selfadjoint_covariance_matrix(const std::array<double, 6>& c,
                                                        std::array<double, 3>& values,
                                                        std::array<double, 9>& vectors) {
    const double mean = (c[0] + c[3] + c[5]) / 3;
    const std::array<Vec3, 3> rest = {
        {{c[0] - mean, c[1], c[2]}, {c[1], c[3] - mean, c[4]}, {c[2], c[4], c[5] - mean}}};
    double squares = 0;
    for (const Vec3& row : rest) squares += dot(row, row);
    const double p = std::sqrt(squares / 6);
    const double half_det = dot(rest[0], cross(rest[1], rest[2])) / (2 * p * p * p);
    const double angle = std::acos(std::clamp(half_det, -1.0, 1.0)) / 3;
    values[2] = mean + 2 * p * std::cos(angle);
    values[0] = mean + 2 * p * std::cos(angle + 2 * std::acos(-1.0) / 3);
    values[1] = 3 * mean - values[0] - values[2];
    std::array<Vec3, 3> rows = rest;
    for (std::size_t k = 0; k < 3; ++k) rows.at(k).at(k) += mean - values[2];
    Vec3 longest{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3 product = cross(rows.at(k), rows.at((k + 1) % 3));
      if (dot(product, product) > dot(longest, longest)) longest = product;
    }
    std::copy(longest.begin(), longest.end(), vectors.begin() + 6);
    return true;
  }
};

TEST(HierarchySubset, IsCgals) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto points = random_points(2000, seed);
    for (const unsigned cluster_size : {1U, 20U, 50U, 5000U}) {
      for (const double variation : {1e-4, 0.001, 0.05, 1.0 / 3}) {
        auto others = cgal_points(points);
        others.erase(CGAL::hierarchy_simplify_point_set(
                         others, CGAL::parameters::size(cluster_size)
                                     .maximum_variation(variation)
                                     .diagonalize_traits(ExactDiagonalization())),
                     others.end());
        std::vector<CgalPoint> kept;
        for (const std::uint32_t k :
             hierarchy_subset(points, static_cast<std::int32_t>(cluster_size), variation)) {
          kept.emplace_back(points[k][0], points[k][1], points[k][2]);
        }
        ASSERT_EQ(kept.size(), others.size()) << cluster_size << ", " << variation;
        // Of a pair either is as near to the middle; rounding decides.
        if (cluster_size > 1 && variation < 0.3) continue;
        std::sort(kept.begin(), kept.end());
        std::sort(others.begin(), others.end());
        ASSERT_EQ(kept, others) << cluster_size << ", " << variation;
      }
    }
  }
}

TEST(HierarchySubset, HandlesPointsThatCannotBeDivided) {
  EXPECT_TRUE(hierarchy_subset({}, 5, 0.1).empty());
  const std::vector<Vec3> same(20, Vec3{1, 2, 3});
  EXPECT_EQ(hierarchy_subset(same, 5, 0.1), PointIndices{0});
  // A lattice in a plane: all variations are 0, and every cut goes through the middle of a square.
  std::vector<Vec3> flat;
  for (int k = 0; k < 64 * 64; ++k) flat.push_back({k % 64 * 1.0, k / 64 * 1.0, 5});
  const auto kept = hierarchy_subset(flat, 16, 0);
  EXPECT_GE(kept.size(), 64U * 64U / 16U);
  EXPECT_LE(kept.size(), 64U * 64U / 4U);
}

}  // namespace
}  // namespace qmpipe::point_subset_test
