#include "stages/surface/constrained_delaunay.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <numeric>
#include <random>
#include <set>

namespace qmpipe::constrained_delaunay_test {
namespace {

using Edge = std::pair<std::uint32_t, std::uint32_t>;

struct Input {
  std::vector<IntPoint> points;
  std::vector<Edge> edges;
};

bool cross(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
  if (a == c || a == d || b == c || b == d) {
    // A common end: they overlap when on one line and on one side of it.
    const IntPoint shared = (a == c || a == d) ? a : b;
    const IntPoint p = shared == a ? b : a;
    const IntPoint q = shared == c ? d : c;
    const std::int64_t along = static_cast<std::int64_t>(p.x - shared.x) * (q.x - shared.x) +
                               static_cast<std::int64_t>(p.y - shared.y) * (q.y - shared.y);
    return orientation(shared, p, q) == 0 && along > 0;
  }
  const auto sign = [](std::int64_t x) { return (x > 0) - (x < 0); };
  // A post of one on the other counts too: it would divide it.
  return sign(orientation(a, b, c)) * sign(orientation(a, b, d)) <= 0 &&
         sign(orientation(c, d, a)) * sign(orientation(c, d, b)) <= 0;
}

// Points of a lattice, where four on a circle are the rule, and segments that do not cross.
Input random_input(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  Input input;
  const std::int32_t step = seed % 2 == 0 ? 128 : 1;
  for (std::int32_t y = 0; y < 24; ++y) {
    for (std::int32_t x = 0; x < 24; ++x) {
      const bool is_corner = (x == 0 || x == 23) && (y == 0 || y == 23);
      if (is_corner || random() % 4 != 0) input.points.push_back({x * step, y * step});
    }
  }
  for (int k = 0; k < 400; ++k) {
    const Edge edge = {static_cast<std::uint32_t>(random() % input.points.size()),
                       static_cast<std::uint32_t>(random() % input.points.size())};
    const auto& a = input.points[edge.first];
    const auto& b = input.points[edge.second];
    const bool is_free = std::none_of(input.edges.begin(), input.edges.end(), [&](const Edge& e) {
      return cross(a, b, input.points[e.first], input.points[e.second]);
    });
    if (edge.first != edge.second && is_free) input.edges.push_back(edge);
  }
  return input;
}

// True when segment ab lies on segment cd.
bool lies_on(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
  const auto between = [&](const IntPoint& p) {
    return orientation(c, d, p) == 0 && std::min(c.x, d.x) <= p.x && p.x <= std::max(c.x, d.x) &&
           std::min(c.y, d.y) <= p.y && p.y <= std::max(c.y, d.y);
  };
  return between(a) && between(b);
}

TEST(ConstrainedDelaunay, CoversTheHullKeepsTheEdgesAndIsDelaunayElsewhere) {
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Input input = random_input(seed);
    ASSERT_GT(input.edges.size(), 5U);
    const auto& p = input.points;
    const auto indices = constrained_delaunay(p, input.edges);
    std::int64_t area = 0;
    std::map<Edge, std::uint32_t> third;  // of the triangle on the left of an edge
    for (std::size_t t = 0; t < indices.size(); t += 3) {
      for (std::size_t k = 0; k < 3; ++k) {
        const Edge edge = {indices[t + k], indices[t + (k + 1) % 3]};
        ASSERT_TRUE(third.emplace(edge, indices[t + (k + 2) % 3]).second);
      }
      const std::int64_t twice = orientation(p[indices[t]], p[indices[t + 1]], p[indices[t + 2]]);
      ASSERT_GT(twice, 0);
      area += twice;
    }
    const std::int64_t side = p.back().x;
    ASSERT_EQ(area, 2 * side * side);
    const auto constrained_by = [&](const Edge& edge) {
      return std::find_if(input.edges.begin(), input.edges.end(), [&](const Edge& e) {
        return lies_on(p[edge.first], p[edge.second], p[e.first], p[e.second]);
      });
    };
    std::map<std::ptrdiff_t, double> kept;  // length of each constraint that is there
    for (const auto& [edge, left] : third) {
      const auto twin = third.find({edge.second, edge.first});
      if (twin == third.end()) continue;
      const auto constraint = constrained_by(edge);
      if (constraint != input.edges.end()) {
        kept[constraint - input.edges.begin()] +=
            std::hypot(p[edge.first].x - p[edge.second].x, p[edge.first].y - p[edge.second].y);
      } else {
        ASSERT_FALSE(in_circle(p[edge.first], p[edge.second], p[left], p[twin->second]));
      }
    }
    for (std::size_t k = 0; k < input.edges.size(); ++k) {
      const IntPoint& a = p[input.edges[k].first];
      const IntPoint& b = p[input.edges[k].second];
      const bool on_hull =
          (a.x == b.x && (a.x == 0 || a.x == side)) || (a.y == b.y && (a.y == 0 || a.y == side));
      if (on_hull) continue;
      // Both directions were counted.
      ASSERT_NEAR(kept[static_cast<std::ptrdiff_t>(k)], 2 * std::hypot(a.x - b.x, a.y - b.y), 1e-6);
    }
  }
}

using Triangle = std::array<std::pair<std::int32_t, std::int32_t>, 3>;

std::set<Triangle> places_of(const std::vector<IntPoint>& points,
                             const std::vector<std::uint32_t>& indices) {
  std::set<Triangle> triangles;
  for (std::size_t t = 0; t < indices.size(); t += 3) {
    Triangle triangle;
    for (std::size_t k = 0; k < 3; ++k) {
      const IntPoint& p = points[indices[t + k]];
      triangle.at(k) = {p.x, p.y};
    }
    std::rotate(triangle.begin(), std::min_element(triangle.begin(), triangle.end()),
                triangle.end());
    triangles.insert(triangle);
  }
  return triangles;
}

TEST(ConstrainedDelaunay, DoesNotDependOnTheOrderOfPointsAndEdges) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Input input = random_input(seed);
    const auto expected = places_of(input.points, constrained_delaunay(input.points, input.edges));
    std::mt19937_64 random(seed);
    std::vector<std::uint32_t> order(input.points.size());
    std::iota(order.begin(), order.end(), 0U);
    std::shuffle(order.begin(), order.end(), random);
    Input shuffled = input;
    for (std::size_t k = 0; k < order.size(); ++k) shuffled.points[order[k]] = input.points[k];
    for (Edge& edge : shuffled.edges) edge = {order[edge.second], order[edge.first]};
    std::shuffle(shuffled.edges.begin(), shuffled.edges.end(), random);
    // Other numbers and other constraints' order; and the same points moved, so that they are
    // inserted in another order, too.
    EXPECT_EQ(places_of(shuffled.points, constrained_delaunay(shuffled.points, shuffled.edges)),
              expected);
    for (IntPoint& p : shuffled.points) p = {p.x + 77, p.y + 1055};
    std::set<Triangle> moved;
    for (Triangle triangle : expected) {
      for (auto& [x, y] : triangle) x += 77, y += 1055;
      moved.insert(triangle);
    }
    EXPECT_EQ(places_of(shuffled.points, constrained_delaunay(shuffled.points, shuffled.edges)),
              moved);
  }
}

TEST(ConstrainedDelaunay, IsExactAtTheEndsOfTheFrame) {
  // Nearly on one circle, as large as can be.
  const std::vector<IntPoint> points = {{0, 0},     {32767, 0},     {32767, 32767},
                                        {0, 32767}, {16383, 32766}, {16384, 1}};
  const auto indices = constrained_delaunay(points, {});
  std::int64_t area = 0;
  for (std::size_t t = 0; t < indices.size(); t += 3) {
    area += orientation(points[indices[t]], points[indices[t + 1]], points[indices[t + 2]]);
    for (const IntPoint& p : points) {
      EXPECT_FALSE(
          in_circle(points[indices[t]], points[indices[t + 1]], points[indices[t + 2]], p));
    }
  }
  EXPECT_EQ(area, 2LL * 32767 * 32767);
}

}  // namespace
}  // namespace qmpipe::constrained_delaunay_test
