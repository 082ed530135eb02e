#include "stages/detail_model/base.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>
#include <utility>

#include "stages/edge_collapse/collapse_mesh.h"

namespace qmpipe::base_test {
namespace {

using Place = std::pair<std::int32_t, std::int32_t>;
using Triangle = std::array<DetailPoint, 3>;

DetailBase base_of(const std::vector<DetailPoint>& points, const BlockGrid& grid) {
  DetailBase base;
  for (auto& block : split_into_blocks(points, grid)) {
    base.blocks.push_back(triangulate_block(std::move(block)));
  }
  base.seams = join_hulls(base.blocks);
  return base;
}

std::vector<Triangle> triangles_of(const BaseBlock& block) {
  std::vector<Triangle> triangles;
  for (std::size_t e = 0; e < block.triangles.size(); e += 3) {
    triangles.push_back({block.points[block.triangles[e]], block.points[block.triangles[e + 1]],
                         block.points[block.triangles[e + 2]]});
  }
  return triangles;
}

std::vector<Triangle> triangles_of(const DetailBase& base) {
  std::vector<Triangle> triangles;
  for (const BaseBlock& block : base.blocks) {
    const auto own = triangles_of(block);
    triangles.insert(triangles.end(), own.begin(), own.end());
  }
  for (const DetailSeam& seam : base.seams) {
    Triangle& t = triangles.emplace_back();
    for (std::size_t k = 0; k < 3; ++k) t[k] = base.blocks[seam[k].block].points[seam[k].point];
  }
  return triangles;
}

Place place_of(const DetailPoint& point) { return {point.x, point.y}; }

// Twice the area of all triangles; -1 when one is not counter-clockwise or an edge is there twice in
// one direction. `rim`: the edges without a triangle on their right.
std::int64_t doubled_area(const std::vector<Triangle>& triangles,
                          std::vector<std::pair<Place, Place>>& rim) {
  std::int64_t sum = 0;
  std::set<std::pair<Place, Place>> edges;
  for (const Triangle& t : triangles) {
    const std::int64_t area = plane_orientation(t[0], t[1], t[2]);
    if (area <= 0) return -1;
    sum += area;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!edges.insert({place_of(t[k]), place_of(t[(k + 1) % 3])}).second) return -1;
    }
  }
  rim.clear();
  for (const auto& [from, to] : edges) {
    if (!edges.contains({to, from})) rim.emplace_back(from, to);
  }
  return sum;
}

std::int64_t doubled_hull_area(std::vector<DetailPoint> points) {
  std::sort(points.begin(), points.end(),
            [](const DetailPoint& a, const DetailPoint& b) { return place_of(a) < place_of(b); });
  std::vector<DetailPoint> hull;
  for (int pass = 0; pass < 2; ++pass) {
    const std::size_t first = hull.size();
    for (const DetailPoint& point : points) {
      while (hull.size() >= first + 2 &&
             plane_orientation(hull[hull.size() - 2], hull.back(), point) <= 0) {
        hull.pop_back();
      }
      hull.push_back(point);
    }
    hull.pop_back();
    std::reverse(points.begin(), points.end());
  }
  std::int64_t area = 0;
  for (std::size_t k = 2; k < hull.size(); ++k) {
    area += plane_orientation(hull[0], hull[k - 1], hull[k]);
  }
  return area;
}

std::vector<DetailPoint> cloud(std::uint32_t seed, int count, std::int32_t extent) {
  std::mt19937 dice(seed);
  std::map<Place, DetailPoint> points;
  for (int k = 0; k < count; ++k) {
    const auto roll = [&](std::int32_t limit) {
      return static_cast<std::int32_t>(dice() % static_cast<std::uint32_t>(limit));
    };
    DetailPoint point = {.x = roll(extent), .y = roll(extent), .z = roll(50)};
    // Half of them in clusters, so that blocks differ.
    if (k % 2 == 0) point = {.x = point.x / 20, .y = point.y / 7, .z = point.z};
    points[place_of(point)] = point;
  }
  std::vector<DetailPoint> list;
  for (const auto& [place, point] : points) list.push_back(point);
  std::shuffle(list.begin(), list.end(), dice);
  return list;
}

TEST(DetailBase, BlocksAndSeamsCoverTheConvexHullOnce) {
  for (const std::uint32_t seed : {1U, 2U, 3U, 4U, 5U}) {
    for (const std::int32_t extent : {12, 400, kDetailGridMax}) {
      for (const std::int32_t blocks : {1, 4, 6, 16}) {
        SCOPED_TRACE("seed " + std::to_string(seed) + " extent " + std::to_string(extent) +
                     " blocks " + std::to_string(blocks));
        const std::vector<DetailPoint> points = cloud(seed, 300, extent);
        const DetailBase base = base_of(points, block_grid_of(blocks));
        std::vector<std::pair<Place, Place>> rim;
        const std::int64_t area = doubled_area(triangles_of(base), rim);
        ASSERT_GT(area, 0);
        EXPECT_EQ(area, doubled_hull_area(points));
        std::size_t count = 0;
        for (const BaseBlock& block : base.blocks) count += block.points.size();
        EXPECT_EQ(count, points.size());
        // Every edge within the hull has a triangle on either side: what remains is one loop.
        std::map<Place, Place> next(rim.begin(), rim.end());
        ASSERT_EQ(next.size(), rim.size());
        std::size_t steps = 0;
        Place at = rim.front().first;
        do {
          at = next.at(at);
          ++steps;
        } while (at != rim.front().first && steps <= rim.size());
        EXPECT_EQ(steps, rim.size());
      }
    }
  }
}

TEST(DetailBase, EachBlockIsDelaunay) {
  const std::vector<DetailPoint> points = cloud(7, 120, 90);
  for (const BaseBlock& block : base_of(points, {.columns = 2, .rows = 2}).blocks) {
    for (const Triangle& t : triangles_of(block)) {
      for (const DetailPoint& p : block.points) {
        // In long double the numbers here are exact.
        std::array<std::array<long double, 3>, 3> m{};
        for (std::size_t k = 0; k < 3; ++k) {
          const long double dx = t[k].x - p.x;
          const long double dy = t[k].y - p.y;
          m[k] = {dx, dy, dx * dx + dy * dy};
        }
        const long double in_circle = m[0][0] * (m[1][1] * m[2][2] - m[1][2] * m[2][1]) -
                                      m[0][1] * (m[1][0] * m[2][2] - m[1][2] * m[2][0]) +
                                      m[0][2] * (m[1][0] * m[2][1] - m[1][1] * m[2][0]);
        ASSERT_LE(in_circle, 0);
      }
    }
  }
}

TEST(DetailBase, TheOrderOfThePointsDoesNotMatter) {
  std::vector<DetailPoint> points = cloud(8, 200, 30);
  const DetailBase first = base_of(points, {.columns = 2, .rows = 2});
  std::mt19937 dice(8);
  std::shuffle(points.begin(), points.end(), dice);
  const DetailBase second = base_of(points, {.columns = 2, .rows = 2});
  for (std::size_t b = 0; b < first.blocks.size(); ++b) {
    EXPECT_EQ(first.blocks[b].points, second.blocks[b].points);
    EXPECT_EQ(first.blocks[b].triangles, second.blocks[b].triangles);
  }
  EXPECT_EQ(first.seams, second.seams);
}

TEST(DetailBase, BlocksOfFewPointsOrPointsOnALineAreJoinedAllTheSame) {
  // South-west: a square; south-east: two points; north-west: three on a line; north-east: none.
  const std::vector<DetailPoint> points = {{0, 0, 1},   {10, 0, 2},  {0, 10, 3},
                                           {10, 10, 4}, {90, 5, 5},  {99, 9, 6},
                                           {0, 80, 7},  {10, 89, 8}, {20, 98, 9}};
  const DetailBase base = base_of(points, {.columns = 2, .rows = 2});
  EXPECT_EQ(base.blocks[1].mesh_points, 0U);
  EXPECT_EQ(base.blocks[2].mesh_points, 0U);
  std::vector<std::pair<Place, Place>> rim;
  EXPECT_EQ(doubled_area(triangles_of(base), rim), doubled_hull_area(points));
}

TEST(DetailBase, GridsWithVoidsHaveEachCellOnceAndMeshesThatCanBeSimplified) {
  for (const std::uint32_t seed : {1U, 2U, 3U, 4U}) {
    for (const double void_share : {0.0, 0.05, 0.4}) {
      SCOPED_TRACE("seed " + std::to_string(seed) + " voids " + std::to_string(void_share));
      std::mt19937 dice(seed);
      const std::int32_t columns = 2 + static_cast<std::int32_t>(dice() % 30);
      const std::int32_t rows = 2 + static_cast<std::int32_t>(dice() % 30);
      std::vector<std::int32_t> z;
      std::vector<std::uint8_t> valid;
      for (std::int32_t k = 0; k < columns * rows; ++k) {
        z.push_back(static_cast<std::int32_t>(dice() % 100));
        valid.push_back(std::uniform_real_distribution<>()(dice) < void_share ? 0 : 1);
      }
      const DetailBase base = grid_base({columns, rows, z, valid}, {.columns = 3, .rows = 2});
      std::vector<std::pair<Place, Place>> rim;
      const std::int64_t area = doubled_area(triangles_of(base), rim);
      std::int64_t expected = 0;
      for (std::int32_t j = 0; j + 1 < rows; ++j) {
        for (std::int32_t i = 0; i + 1 < columns; ++i) {
          int corners = 0;
          for (const std::int32_t k : {0, 1, columns, columns + 1}) {
            corners += valid[static_cast<std::size_t>(j * columns + i + k)];
          }
          expected += std::max(0, corners - 2);
        }
      }
      EXPECT_EQ(area, expected);
      for (const BaseBlock& block : base.blocks) {
        if (block.mesh_points == 0) continue;
        EXPECT_NO_THROW(CollapseMesh(block.triangles, block.mesh_points));
      }
      for (const Triangle& t : triangles_of(base)) {
        for (const DetailPoint& p : t) {
          EXPECT_EQ(p.z, z[static_cast<std::size_t>(p.y * columns + p.x)]);
        }
      }
    }
  }
}

TEST(DetailBase, BlockGridsAreAsSquareAsTheirNumberAllows) {
  const auto text = [](std::int32_t blocks) {
    const BlockGrid grid = block_grid_of(blocks);
    return std::to_string(grid.columns) + "x" + std::to_string(grid.rows);
  };
  EXPECT_EQ(text(1), "1x1");
  EXPECT_EQ(text(4), "2x2");
  EXPECT_EQ(text(6), "3x2");
  EXPECT_EQ(text(7), "7x1");
  EXPECT_EQ(text(64), "8x8");
}

}  // namespace
}  // namespace qmpipe::base_test
