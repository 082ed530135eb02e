#include "stages/surface/curvature.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "stages/surface/geodesy.h"

namespace qmpipe::curvature_test {
namespace {

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

struct Triangle {
  std::array<Post, 3> corners;
  std::array<double, 3> weights;  // of a post inside
  Post inside;
};

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

// A wide triangle around a post, no longer than `extent` posts.
Triangle random_triangle(std::mt19937_64& random, std::int32_t extent) {
  const auto below = [&random](std::int32_t end) {
    return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
  };
  const std::int32_t i = below(kTileIntervals - extent);
  const std::int32_t j = below(kTileIntervals - extent);
  // Thirds, so that the post inside is a whole one.
  const std::int32_t e = extent / 3 * 3;
  return {.corners = {{{i, j}, {i + e, j}, {i + below(2) * e, j + e}}},
          .weights = {1.0 / 3, 1.0 / 3, 1.0 / 3},
          .inside = {}};
}

GeoPoint place(const PostGrid& grid, double i, double j) {
  const auto at = [](const std::vector<double>& values, double k) {
    const auto low = static_cast<std::size_t>(k);
    return values[low] + (k - static_cast<double>(low)) *
                             (values[std::min(low + 1, values.size() - 1)] - values[low]);
  };
  return {at(grid.longitude_deg, i), at(grid.latitude_deg, j), 0};
}

double exact_depth_m(const PostGrid& grid, const Triangle& t) {
  std::array<Vec3, 3> p;
  for (std::size_t k = 0; k < 3; ++k) p[k] = to_ecef(place(grid, t.corners[k].i, t.corners[k].j));
  const GeoPoint inside = place(grid, t.inside.i, t.inside.j);
  const Vec3 normal = cross(minus(p[1], p[0]), minus(p[2], p[0]));
  const Vec3 up = up_at(inside.longitude_deg, inside.latitude_deg);
  return -dot(normal, minus(p[0], to_ecef(inside))) / dot(normal, up);
}

double estimated_depth_m(const CurvatureTerms& terms, const Triangle& t) {
  double latitude = 0;
  double longitude = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    latitude += t.weights[k] * terms.latitude_squared[static_cast<std::size_t>(t.corners[k].j)];
    longitude += t.weights[k] * terms.longitude_squared[static_cast<std::size_t>(t.corners[k].i)];
  }
  const auto row = static_cast<std::size_t>(t.inside.j);
  const double chord = terms.metres_per_unit * (latitude + terms.parallel_scale[row] * longitude);
  return terms.at(t.inside.i, t.inside.j) - chord;
}

// The post inside is where the triangle's corners weigh alike: its coordinates are whole.
bool put_post_inside(Triangle& t) {
  const std::int32_t i = t.corners[0].i + t.corners[1].i + t.corners[2].i;
  const std::int32_t j = t.corners[0].j + t.corners[1].j + t.corners[2].j;
  t.inside = {i / 3, j / 3};
  return i % 3 == 0 && j % 3 == 0;
}

TEST(Curvature, DepthOfAChordIsRightToFivePercentUpToEightDegrees) {
  for (std::int32_t zoom = 0; zoom <= 8; ++zoom) {
    for (std::uint64_t seed = 1; seed <= 200; ++seed) {
      SCOPED_TRACE("zoom " + std::to_string(zoom) + ", seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const auto y =
          static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(kGeodetic.rows(zoom)));
      const PostGrid grid = make_tile_grid(kGeodetic, {zoom, 0, y});
      const double spacing_deg = 180.0 / (1 << zoom) / 256;
      const auto longest = std::min(240, static_cast<std::int32_t>(8 / spacing_deg));
      Triangle t = random_triangle(
          random, std::max(3, static_cast<std::int32_t>(uniform(random, 0.2, 1) * longest)));
      if (!put_post_inside(t)) continue;
      const double latitude_deg = grid.latitude_deg[static_cast<std::size_t>(t.inside.j)];
      if (std::abs(latitude_deg) > 55) continue;
      const double exact = exact_depth_m(grid, t);
      ASSERT_GT(exact, 0);
      ASSERT_NEAR(estimated_depth_m(curvature_terms(grid), t), exact, 0.05 * exact)
          << "at latitude " << latitude_deg;
    }
  }
}

TEST(Curvature, TermsOfPostsAreTheSquaresAtTheirExactPlaces) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const PostGrid grid = make_tile_grid(scheme, {2, 1, 3});
    const CurvatureTerms terms = curvature_terms(grid);
    for (std::size_t k = 0; k < kTilePosts; ++k) {
      ASSERT_NEAR(terms.longitude_squared_at(grid.u_exact[k]), terms.longitude_squared[k], 1e-14);
      ASSERT_NEAR(terms.latitude_squared_at(grid.v_exact[k]), terms.latitude_squared[k], 1e-14);
      const double cosine = std::cos(grid.latitude_deg[k] * std::acos(-1.0) / 180);
      ASSERT_NEAR(terms.parallel_scale[k], cosine * cosine, 1e-15);
    }
  }
}

TEST(Curvature, LargestSagittaBoundsEveryTriangle) {
  for (std::int32_t zoom = 2; zoom <= 8; ++zoom) {
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      SCOPED_TRACE("zoom " + std::to_string(zoom) + ", seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const auto y =
          static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(kGeodetic.rows(zoom)));
      const PostGrid grid = make_tile_grid(kGeodetic, {zoom, 0, y});
      Triangle t = random_triangle(random, 3 + static_cast<std::int32_t>(random() % 250));
      if (!put_post_inside(t)) continue;
      ASSERT_LE(estimated_depth_m(curvature_terms(grid), t), largest_sagitta_m(grid));
    }
  }
}

}  // namespace
}  // namespace qmpipe::curvature_test
