#include "stages/surface/delaunay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>
#include <string>

namespace qmpipe::delaunay_test {
namespace {

using Index = Delaunay::Index;
using Corners = std::array<Index, 3>;
__extension__ using Wide = __int128;

std::int32_t below(std::mt19937_64& random, std::int32_t end) {
  return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
}

// The textbook determinant of lifted points, wide enough for anything.
bool in_circle_slowly(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
  const auto lifted = [&d](const IntPoint& p) {
    const Wide x = p.x - d.x;
    const Wide y = p.y - d.y;
    return std::array<Wide, 3>{x, y, x * x + y * y};
  };
  const auto [ax, ay, az] = lifted(a);
  const auto [bx, by, bz] = lifted(b);
  const auto [cx, cy, cz] = lifted(c);
  return ax * (by * cz - bz * cy) - ay * (bx * cz - bz * cx) + az * (bx * cy - by * cx) > 0;
}

enum class Kind { kAnywhere, kLattice, kSides, kDiagonal, kCluster, kTileLattice };
constexpr std::array kKinds = {Kind::kAnywhere, Kind::kLattice, Kind::kSides,
                               Kind::kDiagonal, Kind::kCluster, Kind::kTileLattice};

IntPoint random_point(Kind kind, std::int32_t size, std::mt19937_64& random) {
  const std::int32_t a = below(random, size + 1);
  const std::int32_t b = below(random, size + 1);
  const std::int32_t step = std::max(1, size / 8);
  switch (kind) {
    case Kind::kAnywhere:
      return {a, b};
    case Kind::kLattice:
      return {a / step * step, b / step * step};
    case Kind::kSides: {
      const std::array<IntPoint, 4> on = {{{0, a}, {a, 0}, {size, a}, {a, size}}};
      return on[static_cast<std::size_t>(b % 4)];
    }
    case Kind::kDiagonal:
      return b % 2 == 0 ? IntPoint{a, a} : IntPoint{a, size - a};
    case Kind::kCluster:
      return {a / 100 + size / 3, b / 100 + size / 3};
    case Kind::kTileLattice:
      return {(a % 17) * size / 16, (b % 17) * size / 16};
  }
  return {};
}

Corners corners_of(const Delaunay& mesh, Index t) {
  return {mesh.vertex(t, 0), mesh.vertex(t, 1), mesh.vertex(t, 2)};
}

// The same triangle whatever corner it starts from.
Corners turned(Corners c) {
  std::rotate(c.begin(), std::min_element(c.begin(), c.end()), c.end());
  return c;
}

std::set<Corners> triangles_of(const Delaunay& mesh) {
  std::set<Corners> triangles;
  for (Index t = 0; t < mesh.triangle_count(); ++t) triangles.insert(turned(corners_of(mesh, t)));
  return triangles;
}

// Orientation, area and twins; empty when all is right.
std::string fault_of_partition(const Delaunay& mesh, std::int32_t size) {
  std::int64_t area = 0;
  std::map<std::pair<Index, Index>, Index> owner;
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    const Corners c = corners_of(mesh, t);
    const std::int64_t twice = orientation(mesh.point(c[0]), mesh.point(c[1]), mesh.point(c[2]));
    if (twice <= 0) return "a triangle that is not counter-clockwise";
    area += twice;
    for (std::size_t k = 0; k < 3; ++k) {
      if (!owner.emplace(std::pair(c[k], c[(k + 1) % 3]), t).second) return "an edge twice";
    }
  }
  if (area != std::int64_t{2} * size * size) return "the square is not covered once";
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    for (int k = 0; k < 3; ++k) {
      const auto twin = owner.find({mesh.vertex(t, (k + 1) % 3), mesh.vertex(t, k)});
      const Index expected = twin == owner.end() ? Delaunay::kNone : twin->second;
      if (mesh.across(t, k) != expected) return "across() leads to the wrong triangle";
    }
  }
  return "";
}

std::string fault_of_circles(const Delaunay& mesh) {
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    const Corners c = corners_of(mesh, t);
    for (Index v = 0; v < mesh.vertex_count(); ++v) {
      if (in_circle_slowly(mesh.point(c[0]), mesh.point(c[1]), mesh.point(c[2]), mesh.point(v))) {
        return "a vertex inside a circumcircle";
      }
    }
  }
  return "";
}

// touched() lists each triangle that differs from before, and nothing twice.
std::string fault_of_touched(const Delaunay& mesh, const std::vector<Corners>& before) {
  const std::set<Index> touched(mesh.touched().begin(), mesh.touched().end());
  if (touched.size() != mesh.touched().size()) return "a touched triangle is listed twice";
  for (Index t = 0; t < mesh.triangle_count(); ++t) {
    const auto at = static_cast<std::size_t>(t);
    const bool changed = at >= before.size() || turned(before[at]) != turned(corners_of(mesh, t));
    if (changed != (touched.count(t) != 0)) return "touched() does not list what changed";
  }
  return "";
}

TEST(InCircle, AgreesWithWideArithmetic) {
  std::mt19937_64 random(7);
  const std::array<std::int32_t, 4> extremes = {0, 1, 32766, 32767};
  const auto coordinate = [&] {
    const std::int32_t any = below(random, 32768);
    return random() % 2 == 0 ? any : extremes[random() % 4];
  };
  for (int k = 0; k < 1'000'000; ++k) {
    IntPoint a = {coordinate(), coordinate()};
    IntPoint b = {coordinate(), coordinate()};
    const IntPoint c = {coordinate(), coordinate()};
    const IntPoint d = {coordinate(), coordinate()};
    if (orientation(a, b, c) < 0) std::swap(a, b);
    if (orientation(a, b, c) == 0) continue;
    ASSERT_EQ(in_circle(a, b, c, d), in_circle_slowly(a, b, c, d))
        << a.x << "," << a.y << " " << b.x << "," << b.y << " " << c.x << "," << c.y << " " << d.x
        << "," << d.y;
  }
}

TEST(InCircle, PointsOnTheCircleAreNotInside) {
  const IntPoint a = {0, 0};
  const IntPoint b = {32767, 0};
  const IntPoint c = {32767, 32767};
  EXPECT_FALSE(in_circle(a, b, c, {0, 32767}));
  EXPECT_FALSE(in_circle(a, b, c, a));
  EXPECT_TRUE(in_circle(a, b, c, {1, 32766}));
  EXPECT_FALSE(in_circle({1, 0}, {32767, 1}, {32766, 32767}, {0, 32767}));
}

TEST(Delaunay, StaysATriangulationOfTheSquareAfterEveryInsertion) {
  for (const Kind kind : kKinds) {
    for (std::uint64_t seed = 1; seed <= 12; ++seed) {
      SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)) + ", seed " +
                   std::to_string(seed));
      std::mt19937_64 random(seed);
      const std::array<std::int32_t, 4> sizes = {3, 16, 257, 32767};
      const std::int32_t size = sizes[seed % 4];
      Delaunay mesh({size, size});
      for (int k = 0; k < 70; ++k) {
        std::vector<Corners> before;
        for (Index t = 0; t < mesh.triangle_count(); ++t) before.push_back(corners_of(mesh, t));
        const IntPoint point = random_point(kind, size, random);
        const Index vertices = mesh.vertex_count();
        const Index vertex = mesh.insert(point, below(random, mesh.triangle_count()));
        ASSERT_EQ(mesh.point(vertex), point);
        ASSERT_EQ(mesh.vertex_count(), vertex == vertices ? vertices + 1 : vertices);
        ASSERT_EQ(fault_of_partition(mesh, size), "");
        ASSERT_EQ(fault_of_circles(mesh), "");
        ASSERT_EQ(fault_of_touched(mesh, before), "");
      }
    }
  }
}

TEST(Delaunay, ALargeSetStaysATriangulation) {
  for (const Kind kind : {Kind::kAnywhere, Kind::kTileLattice, Kind::kCluster}) {
    std::mt19937_64 random(11);
    Delaunay mesh({32767, 32767});
    for (int k = 0; k < 3000; ++k) {
      const Index near = mesh.touched().empty() ? 0 : mesh.touched().back();
      mesh.insert(random_point(kind, 32767, random), near);
    }
    EXPECT_EQ(fault_of_partition(mesh, 32767), "");
  }
}

TEST(Delaunay, RepeatedPointsAreNotAddedAgain) {
  std::mt19937_64 random(13);
  Delaunay mesh({1000, 1000});
  std::vector<IntPoint> points = {{0, 0}, {1000, 0}, {1000, 1000}, {0, 1000}};
  for (int k = 0; k < 100; ++k) {
    points.push_back(random_point(Kind::kAnywhere, 1000, random));
    mesh.insert(points.back(), 0);
  }
  const std::set<Corners> triangles = triangles_of(mesh);
  const Index vertices = mesh.vertex_count();
  for (const IntPoint& point : points) {
    const Index vertex = mesh.insert(point, below(random, mesh.triangle_count()));
    ASSERT_EQ(mesh.point(vertex), point);
    ASSERT_TRUE(mesh.touched().empty());
    ASSERT_EQ(mesh.vertex_count(), vertices);
  }
  EXPECT_EQ(triangles_of(mesh), triangles);
}

TEST(Delaunay, TheResultDoesNotDependOnWhereTheSearchStarts) {
  for (const Kind kind : kKinds) {
    for (std::uint64_t seed = 1; seed <= 20; ++seed) {
      SCOPED_TRACE("kind " + std::to_string(static_cast<int>(kind)) + ", seed " +
                   std::to_string(seed));
      std::mt19937_64 random(seed);
      Delaunay from_first({4096, 4096});
      Delaunay from_anywhere({4096, 4096});
      for (int k = 0; k < 150; ++k) {
        const IntPoint point = random_point(kind, 4096, random);
        from_first.insert(point, 0);
        from_anywhere.insert(point, below(random, from_anywhere.triangle_count()));
      }
      ASSERT_EQ(triangles_of(from_first), triangles_of(from_anywhere));
    }
  }
}

TEST(Delaunay, LocateFindsATriangleThatHoldsThePoint) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const Kind kind = kKinds[seed % kKinds.size()];
    Delaunay mesh({32767, 32767});
    for (int k = 0; k < 200; ++k) mesh.insert(random_point(kind, 32767, random), 0);
    for (int k = 0; k < 500; ++k) {
      const IntPoint p = random_point(kKinds[random() % kKinds.size()], 32767, random);
      const Index t = mesh.locate(p, below(random, mesh.triangle_count()));
      for (int c = 0; c < 3; ++c) {
        ASSERT_GE(
            orientation(mesh.point(mesh.vertex(t, c)), mesh.point(mesh.vertex(t, (c + 1) % 3)), p),
            0);
      }
    }
  }
}

}  // namespace
}  // namespace qmpipe::delaunay_test
