#include "stages/point_sets/sharp_edges.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "stages/surface/base_tin.h"

namespace qmpipe::sharp_edges_test {
namespace {

constexpr std::int32_t kPosts = 41;
constexpr std::int32_t kMiddle = 20;

Tin terrain(const std::function<double(int i, int j)>& height_m) {
  const PostGrid grid = make_plane_grid(kPosts, kPosts, 10, 10);
  std::vector<float> heights_m;
  for (std::int32_t j = 0; j < kPosts; ++j) {
    for (std::int32_t i = 0; i < kPosts; ++i) {
      heights_m.push_back(static_cast<float>(height_m(i, j)));
    }
  }
  return base_tin(grid, heights_m, {}, 0x1p-10);
}

// The posts from a to b, both included; either is in the other's row or column.
VertexPolyline straight(Post a, Post b) {
  VertexPolyline result;
  const std::int32_t n = std::max(std::abs(b.i - a.i), std::abs(b.j - a.j));
  for (std::int32_t k = 0; k <= n; ++k) {
    const std::int32_t i = a.i + (b.i - a.i) / n * k;
    const std::int32_t j = a.j + (b.j - a.j) / n * k;
    result.push_back(static_cast<std::uint32_t>(j * kPosts + i));
  }
  return result;
}

TEST(SharpEdges, ACrestIsOnePolylineFromSideToSide) {
  const Tin roof = terrain([](int i, int) { return -std::abs(i - kMiddle); });
  const auto polylines = sharp_polylines(roof, {});
  ASSERT_EQ(polylines.size(), 1U);
  EXPECT_EQ(polylines[0], straight({kMiddle, 0}, {kMiddle, kPosts - 1}));
}

TEST(SharpEdges, AreAsSharpInAnyUnitOfHeight) {
  for (const double scale : {0.01, 1.0, 1000.0}) {
    // In scaled coordinates a ramp of 45 degrees, level ground and a wall of 87 degrees.
    const Tin roof = terrain([&](int i, int) {
      return scale * (i < kMiddle ? i : kMiddle) + (i > 2 * kMiddle - 2 ? scale * kMiddle : 0);
    });
    const auto slope = [&](double angle_deg) {
      return sharp_polylines(roof, {.angle_deg = angle_deg}).size();
    };
    EXPECT_EQ(slope(44), 3U);  // the end of the ramp, and both ends of the wall
    EXPECT_EQ(slope(46), 2U);
    EXPECT_EQ(slope(89), 0U);
  }
}

TEST(SharpEdges, FlatTerrainHasNone) {
  EXPECT_TRUE(sharp_polylines(terrain([](int, int) { return 7; }), {.least_points = 1}).empty());
  EXPECT_TRUE(sharp_polylines(terrain([](int i, int j) { return i + 2 * j; }), {.least_points = 1})
                  .empty());
}

constexpr std::uint32_t kSpokes = 48;
constexpr std::uint32_t kRings = 10;

std::uint32_t ring_vertex(std::uint32_t ring, std::uint32_t spoke) {
  return 1 + ring * kSpokes + spoke % kSpokes;
}

// Rings of vertices round a middle one, vertex 0, whose height is 0.
Tin wheel(const std::function<double(std::uint32_t ring, double angle_rad)>& height_m) {
  Tin tin;
  tin.vertices.push_back({.u = 16000, .v = 16000, .post = kNoPost, .height_m = 0});
  for (std::uint32_t ring = 0; ring < kRings; ++ring) {
    for (std::uint32_t k = 0; k < kSpokes; ++k) {
      const double angle_rad = 2 * std::acos(-1.0) * k / kSpokes;
      const double radius = 1600.0 * (ring + 1);
      tin.vertices.push_back(
          {.u = static_cast<std::int32_t>(std::lround(16000 + radius * std::cos(angle_rad))),
           .v = static_cast<std::int32_t>(std::lround(16000 + radius * std::sin(angle_rad))),
           .post = kNoPost,
           .height_m = height_m(ring, angle_rad)});
    }
  }
  const auto add = [&](std::uint32_t a, std::uint32_t b, std::uint32_t c) {
    for (const std::uint32_t k : {a, b, c}) tin.indices.push_back(k);
  };
  for (std::uint32_t k = 0; k < kSpokes; ++k) {
    add(0, ring_vertex(0, k), ring_vertex(0, k + 1));
    for (std::uint32_t ring = 1; ring < kRings; ++ring) {
      add(ring_vertex(ring - 1, k), ring_vertex(ring, k), ring_vertex(ring, k + 1));
      add(ring_vertex(ring - 1, k), ring_vertex(ring, k + 1), ring_vertex(ring - 1, k + 1));
    }
  }
  return tin;
}

// Three crests rise from the middle, with round valleys between them.
TEST(SharpEdges, PolylinesEndWhereThreeMeet) {
  const Tin crests = wheel([](std::uint32_t ring, double angle_rad) {
    return (ring + 1) * (1 - std::abs(std::sin(1.5 * angle_rad)));
  });
  auto polylines = sharp_polylines(crests, {.angle_deg = 80, .least_points = kRings + 1});
  ASSERT_EQ(polylines.size(), 3U);
  std::sort(polylines.begin(), polylines.end());
  for (std::uint32_t n = 0; n < 3; ++n) {
    VertexPolyline expected = {0};
    for (std::uint32_t ring = 0; ring < kRings; ++ring) {
      expected.push_back(ring_vertex(ring, n * kSpokes / 3));
    }
    EXPECT_EQ(polylines[n], expected);
  }
  EXPECT_TRUE(sharp_polylines(crests, {.angle_deg = 80, .least_points = kRings + 2}).empty());
}

// A round pit with a flat floor.
TEST(SharpEdges, AClosedPolylineEndsAtItsFirstVertex) {
  const Tin pit = wheel([](std::uint32_t ring, double) { return ring < 5 ? 0 : 1000; });
  const auto loops = sharp_polylines(pit, {.angle_deg = 60, .least_points = kSpokes});
  ASSERT_EQ(loops.size(), 2U);
  for (std::uint32_t n = 0; n < 2; ++n) {
    ASSERT_EQ(loops[n].size(), kSpokes + 1);
    EXPECT_EQ(loops[n].front(), ring_vertex(4 + n, 0));
    EXPECT_EQ(loops[n].back(), ring_vertex(4 + n, 0));
    auto sorted = loops[n];
    std::sort(sorted.begin(), sorted.end() - 1);
    for (std::uint32_t k = 0; k < kSpokes; ++k) EXPECT_EQ(sorted[k], ring_vertex(4 + n, k));
  }
  EXPECT_TRUE(sharp_polylines(pit, {.angle_deg = 60, .least_points = kSpokes + 1}).empty());
}

}  // namespace
}  // namespace qmpipe::sharp_edges_test
