#include "stages/detail_model/block.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>

#include "stages/detail_model/increment.h"
#include "tests/support/detail_fixture.h"

namespace qmpipe::block_test {
namespace {

using testing::DetailMesh;
using testing::hilly_mesh;

OrderedBlock block_of(const DetailMesh& mesh, std::int64_t target) {
  return make_detail_block(mesh.points, mesh.triangles,
                           simplify_by_quadrics(mesh.points, mesh.triangles, {}, target));
}

DetailWalk start(const DetailBlock& block) {
  auto walk = DetailWalk::start(block);
  EXPECT_TRUE(walk.ok());
  return std::move(*walk);
}

std::vector<TriangleVertices> triangles_of(const DetailWalk& walk) {
  std::vector<TriangleVertices> triangles;
  const auto vertices = walk.triangles();
  for (std::size_t k = 0; k < vertices.size(); k += 3) {
    triangles.push_back({vertices[k], vertices[k + 1], vertices[k + 2]});
  }
  return triangles;
}

// From the lowest vertex, in order.
std::vector<TriangleVertices> canonical(std::vector<TriangleVertices> triangles) {
  for (TriangleVertices& t : triangles) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
  }
  std::sort(triangles.begin(), triangles.end());
  return triangles;
}

std::string fault_of(const DetailBlock& block, const std::vector<TriangleVertices>& triangles,
                     std::set<std::pair<std::uint32_t, std::uint32_t>>& rim) {
  std::map<std::pair<std::uint32_t, std::uint32_t>, int> edges;
  rim.clear();
  for (const TriangleVertices& t : triangles) {
    if (plane_orientation(block.points[t[0]], block.points[t[1]], block.points[t[2]]) <= 0) {
      return "a triangle is not counter-clockwise";
    }
    for (std::size_t k = 0; k < 3; ++k) {
      if (++edges[{t[k], t[(k + 1) % 3]}] > 1) return "an edge twice the same way";
    }
  }
  for (const auto& [ends, count] : edges) {
    if (!edges.contains({ends.second, ends.first})) rim.insert(ends);
  }
  return "";
}

const std::set<std::int32_t> kHoles = {35, 36, 37, 90, 200, 201};

TEST(DetailBlock, TheFinestLevelIsTheMeshItWasMadeFrom) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const DetailMesh mesh = hilly_mesh(16, 17, seed, kHoles);
    const OrderedBlock made = block_of(mesh, 80);
    DetailWalk walk = start(made.block);
    ASSERT_FALSE(walk.go_to(made.block.levels()));
    std::vector<TriangleVertices> back = triangles_of(walk);
    for (TriangleVertices& t : back) {
      for (std::uint32_t& v : t) v = made.order[v];
    }
    std::vector<TriangleVertices> given;
    for (std::size_t k = 0; k < mesh.triangles.size(); k += 3) {
      given.push_back({mesh.triangles[k], mesh.triangles[k + 1], mesh.triangles[k + 2]});
    }
    EXPECT_EQ(canonical(back), canonical(given));
    for (std::size_t k = 0; k < made.order.size(); ++k) {
      EXPECT_EQ(made.block.points[k], mesh.points[made.order[k]]);
    }
  }
}

TEST(DetailBlock, EveryLevelIsASoundSurfaceWithTheSameRimAndTheSameOnTheWayBack) {
  for (const std::uint32_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const OrderedBlock made = block_of(hilly_mesh(16, 17, seed, kHoles), 80);
    const DetailBlock& block = made.block;
    ASSERT_GT(block.levels(), 100U);
    DetailWalk walk = start(block);
    std::set<std::pair<std::uint32_t, std::uint32_t>> first_rim;
    std::set<std::pair<std::uint32_t, std::uint32_t>> rim;
    ASSERT_EQ(fault_of(block, triangles_of(walk), first_rim), "");
    std::vector<std::vector<TriangleVertices>> levels = {triangles_of(walk)};
    while (walk.level() < block.levels()) {
      ASSERT_FALSE(walk.refine());
      levels.push_back(triangles_of(walk));
      ASSERT_EQ(levels.back().size(), block.triangles_at(walk.level()));
      ASSERT_EQ(fault_of(block, levels.back(), rim), "") << walk.level();
      ASSERT_EQ(rim, first_rim) << walk.level();
    }
    while (walk.level() > 0) {
      walk.coarsen();
      ASSERT_EQ(triangles_of(walk), levels[walk.level()]);
    }
    std::mt19937 dice(seed);
    for (int k = 0; k < 40; ++k) {
      const std::size_t level = dice() % (block.levels() + 1);
      ASSERT_FALSE(walk.go_to(level));
      ASSERT_EQ(triangles_of(walk), levels[level]);
    }
  }
}

TEST(DetailBlock, TheSmallestVisibleObjectNeverGrowsTowardsFinerLevels) {
  const OrderedBlock made = block_of(hilly_mesh(30, 30, 4), 200);
  const std::vector<float>& svo = made.block.svo_m;
  ASSERT_EQ(svo.size(), made.block.levels() + 1);
  EXPECT_TRUE(std::is_sorted(svo.rbegin(), svo.rend()));
  EXPECT_GT(svo.front(), 2 * svo.back());
}

TEST(DetailBlock, SameInputSameBlock) {
  const DetailMesh mesh = hilly_mesh(25, 24, 9, {3, 77});
  EXPECT_EQ(block_of(mesh, 300).block, block_of(mesh, 300).block);
}

TEST(DetailIncrement, LeadsFromLevelToLevelBothWays) {
  const OrderedBlock made = block_of(hilly_mesh(16, 17, 5, kHoles), 80);
  for (const std::size_t interval : {1U, 3U, 10U, 1000U}) {
    SCOPED_TRACE(interval);
    DetailWalk walk = start(made.block);
    std::vector<std::vector<TriangleVertices>> levels = {triangles_of(walk)};
    std::vector<DetailIncrement> increments;
    while (walk.level() < made.block.levels()) {
      auto increment = increment_to(walk, std::min(walk.level() + interval, made.block.levels()));
      ASSERT_TRUE(increment.ok());
      increments.push_back(std::move(*increment));
      levels.push_back(triangles_of(walk));
    }
    std::vector<TriangleVertices> triangles = levels.front();
    for (std::size_t k = 0; k < increments.size(); ++k) {
      refine_by(increments[k], triangles);
      ASSERT_EQ(triangles, levels[k + 1]);
    }
    for (std::size_t k = increments.size(); k-- > 0;) {
      coarsen_by(increments[k], triangles);
      ASSERT_EQ(triangles, levels[k]);
    }
  }
}

TEST(DetailIncrement, HoldsEachTriangleOnceAndOnlyWhatStandsAtItsEnds) {
  const OrderedBlock made = block_of(hilly_mesh(16, 17, 6), 80);
  DetailWalk single = start(made.block);
  std::size_t one_by_one = 0;
  while (single.level() < made.block.levels()) {
    one_by_one += increment_to(single, single.level() + 1)->changed();
  }
  DetailWalk walk = start(made.block);
  const auto all = increment_to(walk, made.block.levels());
  ASSERT_TRUE(all.ok());
  EXPECT_EQ(all->deleted.size(), 2 * made.block.levels());
  EXPECT_TRUE(std::is_sorted(all->replaced.begin(), all->replaced.end()));
  EXPECT_EQ(std::adjacent_find(all->replaced.begin(), all->replaced.end()), all->replaced.end());
  EXPECT_LT(all->replaced.back(), made.block.coarse_triangles.size() / 3);
  EXPECT_LT(all->changed(), one_by_one / 2);
}

TEST(DetailWalk, DamagedBlocksAreRefusedAndDoNoHarm) {
  const DetailBlock sound = block_of(hilly_mesh(12, 11, 7), 60).block;
  const std::uint32_t seed = 20261123;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 dice(seed);
  int refused = 0;
  for (int round = 0; round < 2000; ++round) {
    DetailBlock block = sound;
    const auto value = static_cast<std::uint32_t>(dice() % 4 == 0 ? dice() : dice() % 400);
    switch (dice() % 3) {
      case 0:
        block.coarse_triangles[dice() % block.coarse_triangles.size()] = value;
        break;
      case 1:
        block.splits[dice() % block.splits.size()].half_edge = value;
        break;
      default:
        block.splits[dice() % block.splits.size()].fan = value;
    }
    auto walk = DetailWalk::start(block);
    if (!walk) {
      ++refused;
      continue;
    }
    const auto error = walk->go_to(block.levels());
    refused += error ? 1 : 0;
    for (const std::uint32_t vertex : walk->triangles()) ASSERT_LT(vertex, block.points.size());
    ASSERT_FALSE(walk->go_to(0));
    ASSERT_TRUE(std::equal(walk->triangles().begin(), walk->triangles().end(),
                           block.coarse_triangles.begin(), block.coarse_triangles.end()));
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace qmpipe::block_test
