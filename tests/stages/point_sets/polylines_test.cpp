#include "stages/point_sets/polylines.h"

#include <CGAL/Constrained_Delaunay_triangulation_2.h>
#include <CGAL/Constrained_triangulation_plus_2.h>
#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polyline_simplification_2/simplify.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>

#include "stages/point_sets/sharp_edges.h"
#include "stages/surface/base_tin.h"
#include "stages/surface/metric_frame.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::polylines_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

constexpr double kEverything = 1e9;

std::size_t at(std::int32_t k) { return static_cast<std::size_t>(k); }

struct Input {
  PostGrid grid;
  std::vector<double> heights_m;
  std::vector<Polyline> polylines;
};

Vec3 position(const Input& input, std::int32_t post) {
  const FlatScale scale = flat_scale(input.grid);
  return {input.grid.u[at(input.grid.column(post))] * scale.metres_per_u,
          input.grid.v[at(input.grid.row(post))] * scale.metres_per_v, input.heights_m[at(post)]};
}

double distance_m(const Vec3& p, const Vec3& a, const Vec3& b) {
  const double t = dot(minus(p, a), minus(b, a)) / dot(minus(b, a), minus(b, a));
  return length(minus(p, plus(a, scaled(minus(b, a), std::clamp(t, 0.0, 1.0)))));
}

IntPoint place(const Input& input, std::int32_t post) {
  return {input.grid.u[at(input.grid.column(post))], input.grid.v[at(input.grid.row(post))]};
}

// The borders and sharp edges of random terrain. Noise on the heights makes all errors different.
Input random_input(Terrain terrain, std::uint64_t seed) {
  std::mt19937_64 random(seed);
  auto heights_m = random_terrain(terrain, random);
  for (float& h : heights_m) h += static_cast<float>(random() % 1000000) * 1e-6F;
  Input input;
  const TilingScheme scheme(seed % 2 == 0 ? Projection::kMercator : Projection::kGeodetic);
  input.grid = make_tile_grid(scheme, {9, 300, 320});
  input.heights_m.assign(heights_m.begin(), heights_m.end());
  const Tin base = base_tin(input.grid, heights_m, {}, 0x1p-20);
  for (const Side side : kSides) {
    Polyline border{.posts = {}, .longest_edge = kQuantizedMax / 10.0};
    for (std::int32_t k = 0; k < kTilePosts; ++k) {
      const Post p = side_post(side, k);
      border.posts.push_back(input.grid.index(p.i, p.j));
    }
    input.polylines.push_back(border);
  }
  for (const VertexPolyline& polyline :
       sharp_polylines(base, {.angle_deg = 40, .least_points = 3})) {
    input.polylines.emplace_back();
    for (const std::uint32_t k : polyline) {
      input.polylines.back().posts.push_back(base.vertices[k].post);
    }
  }
  return input;
}

// True when two segments without a common end touch, or two with one lie on each other.
bool collide(const IntPoint& a, const IntPoint& b, const IntPoint& c, const IntPoint& d) {
  const auto sign = [](std::int64_t x) { return (x > 0) - (x < 0); };
  if (std::max(a.x, b.x) < std::min(c.x, d.x) || std::max(c.x, d.x) < std::min(a.x, b.x) ||
      std::max(a.y, b.y) < std::min(c.y, d.y) || std::max(c.y, d.y) < std::min(a.y, b.y)) {
    return false;
  }
  const bool share = a == c || a == d || b == c || b == d;
  if (!share) {
    return sign(orientation(a, b, c)) * sign(orientation(a, b, d)) <= 0 &&
           sign(orientation(c, d, a)) * sign(orientation(c, d, b)) <= 0;
  }
  const IntPoint shared = (a == c || a == d) ? a : b;
  const IntPoint p = shared == a ? b : a;
  const IntPoint q = shared == c ? d : c;
  return orientation(shared, p, q) == 0 &&
         static_cast<std::int64_t>(p.x - shared.x) * (q.x - shared.x) +
                 static_cast<std::int64_t>(p.y - shared.y) * (q.y - shared.y) >
             0;
}

void expect_right(const Input& input, const std::vector<Polyline>& simple, double error_m) {
  ASSERT_EQ(simple.size(), input.polylines.size());
  std::vector<std::pair<IntPoint, IntPoint>> segments;
  for (std::size_t k = 0; k < simple.size(); ++k) {
    const auto& before = input.polylines[k].posts;
    const auto& after = simple[k].posts;
    ASSERT_EQ(after.front(), before.front());
    ASSERT_EQ(after.back(), before.back());
    std::size_t n = 0;
    for (const std::int32_t post : before) {
      const bool is_last = n + 1 == after.size();
      if (!is_last && n > 0 && post != after[n]) {
        ASSERT_LE(distance_m(position(input, post), position(input, after[n - 1]),
                             position(input, after[n])),
                  error_m * (1 + 1e-12));
      }
      if (post == after[n] && !is_last) ++n;
    }
    ASSERT_EQ(n + 1, after.size());
    for (n = 1; n < after.size(); ++n) {
      const IntPoint a = place(input, after[n - 1]);
      const IntPoint b = place(input, after[n]);
      segments.emplace_back(a, b);
      ASSERT_LE(std::hypot(a.x - b.x, a.y - b.y), input.polylines[k].longest_edge);
    }
  }
  for (std::size_t k = 0; k < segments.size(); ++k) {
    for (std::size_t n = 0; n < k; ++n) {
      ASSERT_FALSE(
          collide(segments[k].first, segments[k].second, segments[n].first, segments[n].second));
    }
  }
}

class PolylinesOf : public ::testing::TestWithParam<Terrain> {};

TEST_P(PolylinesOf, StayNearAndDoNotCross) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Input input = random_input(GetParam(), seed);
    for (const double error_m : {0.1, 30.0, kEverything}) {
      expect_right(input, simplify_polylines(input.grid, input.heights_m, input.polylines, error_m),
                   error_m);
    }
  }
}

using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Structure =
    CGAL::Triangulation_data_structure_2<CGAL::Polyline_simplification_2::Vertex_base_2<Kernel>,
                                         CGAL::Constrained_triangulation_face_base_2<Kernel>>;
using Cdt =
    CGAL::Constrained_Delaunay_triangulation_2<Kernel, Structure, CGAL::Exact_predicates_tag>;
using CgalPolylines = CGAL::Constrained_triangulation_plus_2<Cdt>;

// The same cost as ours, over CGAL's structure.
struct CostInSpace {
  const Input& input;
  const std::map<std::pair<int, int>, std::int32_t>& posts;

  template <class Point>
  std::int32_t post(const Point& p) const {
    return posts.at({static_cast<int>(p.x()), static_cast<int>(p.y())});
  }
  boost::optional<double> operator()(const CgalPolylines& polylines,
                                     CgalPolylines::Vertices_in_constraint_iterator it) const {
    auto from = it;
    auto to = it;
    --from;
    ++to;
    const std::int32_t a = post((*from)->point());
    const std::int32_t b = post((*to)->point());
    const bool on_border = [&] {
      const auto& p = (*it)->point();
      return p.x() == 0 || p.y() == 0 || p.x() == kQuantizedMax || p.y() == kQuantizedMax;
    }();
    const IntPoint pa = place(input, a);
    const IntPoint pb = place(input, b);
    if (on_border && std::hypot(pa.x - pb.x, pa.y - pb.y) > kQuantizedMax / 10.0) return {};
    (void)polylines;
    CgalPolylines::Points_in_constraint_iterator k(from);
    const CgalPolylines::Points_in_constraint_iterator end(to);
    double largest = 0;
    for (++k; k != end; ++k) {
      largest = std::max(
          largest, distance_m(position(input, post(*k)), position(input, a), position(input, b)));
    }
    return largest;
  }
};

TEST_P(PolylinesOf, AreTheOnesThatCgalLeaves) {
  const Input input = random_input(GetParam(), 5);
  ASSERT_GE(input.polylines.size(), 20U);
  std::map<std::pair<int, int>, std::int32_t> posts;
  for (std::int32_t post = 0; post < static_cast<std::int32_t>(kTilePostCount); ++post) {
    posts[{place(input, post).x, place(input, post).y}] = post;
  }
  for (const double error_m : {0.3, 20.0, 300.0}) {
    SCOPED_TRACE("error " + std::to_string(error_m) + ", seed 5");
    CgalPolylines others;
    std::vector<CgalPolylines::Constraint_id> ids;
    for (const Polyline& polyline : input.polylines) {
      std::vector<Kernel::Point_2> points;
      for (const std::int32_t post : polyline.posts) {
        points.emplace_back(place(input, post).x, place(input, post).y);
      }
      ids.push_back(others.insert_constraint(points.begin(), points.end()));
    }
    const CostInSpace cost{input, posts};
    CGAL::Polyline_simplification_2::simplify(
        others, cost, CGAL::Polyline_simplification_2::Stop_above_cost_threshold(error_m));
    const auto ours = simplify_polylines(input.grid, input.heights_m, input.polylines, error_m);
    for (std::size_t k = 0; k < ids.size(); ++k) {
      std::vector<std::int32_t> expected;
      for (auto it = others.vertices_in_constraint_begin(ids[k]);
           it != others.vertices_in_constraint_end(ids[k]); ++it) {
        expected.push_back(cost.post((*it)->point()));
      }
      ASSERT_EQ(ours[k].posts, expected) << "polyline " << k;
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Terrains, PolylinesOf,
                         ::testing::Values(Terrain::kRidges, Terrain::kCliffs, Terrain::kNoise,
                                           Terrain::kSteps),
                         [](const auto& terrain) { return std::string(name_of(terrain.param)); });

// Posts of a plane, ten metres apart and all at height 0.
Input plane(std::int32_t width, std::int32_t height, std::vector<std::vector<Post>> polylines) {
  Input input;
  input.grid = make_plane_grid(width, height, 10, 10);
  input.heights_m.assign(input.grid.post_count(), 0);
  for (const auto& polyline : polylines) {
    input.polylines.emplace_back();
    for (const Post& p : polyline) {
      input.polylines.back().posts.push_back(input.grid.index(p.i, p.j));
    }
  }
  return input;
}

std::vector<std::size_t> sizes(const Input& input, double error_m) {
  const auto simple = simplify_polylines(input.grid, input.heights_m, input.polylines, error_m);
  std::vector<std::size_t> result;
  for (const Polyline& polyline : simple) result.push_back(polyline.posts.size());
  return result;
}

TEST(Polylines, AStraightLineIsItsEndsAndHeightsBendIt) {
  std::vector<Post> line;
  for (std::int32_t i = 0; i < 30; ++i) line.push_back({i, 3});
  Input input = plane(30, 8, {line});
  EXPECT_EQ(sizes(input, 1e-9), std::vector<std::size_t>{2});
  input.heights_m[at(input.grid.index(14, 3))] = 5;
  EXPECT_EQ(sizes(input, 5), std::vector<std::size_t>{2});
  EXPECT_EQ(sizes(input, 4.9), std::vector<std::size_t>{3});
}

TEST(Polylines, EdgesAreNoLongerThanAllowed) {
  std::vector<Post> line;
  for (std::int32_t i = 0; i < 41; ++i) line.push_back({i, 3});
  Input input = plane(41, 8, {line});
  const std::int32_t unit = input.grid.u[1];
  input.polylines[0].longest_edge = 10 * unit;
  const auto simple = simplify_polylines(input.grid, input.heights_m, input.polylines, 1);
  for (std::size_t k = 1; k < simple[0].posts.size(); ++k) {
    EXPECT_LE(simple[0].posts[k] - simple[0].posts[k - 1], 10);
  }
  EXPECT_LE(simple[0].posts.size(), 9U);
  input.polylines[0].longest_edge = 0;
  EXPECT_EQ(sizes(input, kEverything), std::vector<std::size_t>{41});
}

TEST(Polylines, APointStaysWhileAnotherPolylineIsInTheWay) {
  const std::vector<Post> outer = {{0, 0}, {10, 10}, {20, 0}};
  EXPECT_EQ(sizes(plane(21, 21, {outer}), kEverything), (std::vector<std::size_t>{2}));
  // Ends inside.
  EXPECT_EQ(sizes(plane(21, 21, {outer, {{10, 4}, {11, 4}}}), kEverything),
            (std::vector<std::size_t>{3, 2}));
  // Just touches the new edge, from either side.
  EXPECT_EQ(sizes(plane(21, 21, {outer, {{10, 0}, {11, 4}}}), kEverything),
            (std::vector<std::size_t>{3, 2}));
  // Beyond it.
  EXPECT_EQ(sizes(plane(21, 21, {{{0, 1}, {10, 11}, {20, 1}}, {{10, 0}, {11, 0}}}), kEverything),
            (std::vector<std::size_t>{2, 2}));
}

TEST(Polylines, PostsOfTwoPolylinesStay) {
  const Input input = plane(21, 21, {{{0, 5}, {10, 5}, {15, 5}, {20, 5}}, {{10, 5}, {10, 20}}});
  const auto simple = simplify_polylines(input.grid, input.heights_m, input.polylines, kEverything);
  EXPECT_EQ(simple[0].posts,
            (std::vector<std::int32_t>{input.grid.index(0, 5), input.grid.index(10, 5),
                                       input.grid.index(20, 5)}));
}

TEST(Polylines, AClosedOneEndsAsATriangleAtLeast) {
  const std::vector<Post> square = {{5, 5}, {15, 5}, {15, 15}, {5, 15}, {5, 5}};
  EXPECT_EQ(sizes(plane(21, 21, {square}), kEverything), std::vector<std::size_t>{4});
}

}  // namespace
}  // namespace qmpipe::polylines_test
