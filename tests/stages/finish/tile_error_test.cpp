#include "stages/finish/tile_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/finish/finer_error.h"
#include "stages/finish/mesh_order.h"
#include "stages/finish/quantize.h"
#include "stages/greedy/greedy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::tile_error_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

struct Case {
  PostGrid grid;
  Tin tin;
  QuantizedMesh mesh;
  std::vector<float> heights_m;
  std::vector<std::uint8_t> valid;
};

Case random_case(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const TilingScheme scheme(seed % 2 == 0 ? Projection::kGeodetic : Projection::kMercator);
  Case c;
  c.grid = make_tile_grid(scheme, {2, 1, static_cast<std::int32_t>(random() % 4)});
  c.heights_m = random_terrain(kTerrains[seed % kTerrains.size()], random);
  c.tin = strip_ordered(
      greedy_insertion(c.grid, c.heights_m, {},
                       {.tolerance_m = 40, .height_steps = 1, .curvature = Curvature::kIgnored}));
  c.mesh = quantize(c.grid, c.tin, 1);
  // Judged against other heights than it was made from, so that errors are large too.
  for (float& h : c.heights_m) h += static_cast<float>(random() % 100) / 10;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    c.valid.push_back(random() % 3 == 0 ? 0 : 1);
    if (c.valid[k] == 0) c.heights_m[k] = 1e9F;
  }
  return c;
}

// Decoded heights interpolated at exact places.
std::vector<double> surface_slowly(const Case& c) {
  const auto places = locate_posts_slowly(c.grid, corners_of(c.tin), c.mesh.indices);
  std::vector<double> surface(kTilePostCount, 0);
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      surface[k] += places[k].weights[corner] *
                    decoded_height_m(c.mesh, c.mesh.indices[3 * places[k].triangle + corner]);
    }
  }
  return surface;
}

enum class Vertices { kWhereTheFilePutsThem, kInPlace };

std::vector<double> errors_slowly(const Case& c, Vertices vertices) {
  std::vector<double> surface = surface_slowly(c);
  for (std::size_t v = 0; v < c.tin.vertices.size(); ++v) {
    if (vertices == Vertices::kInPlace) break;
    surface[static_cast<std::size_t>(c.tin.vertices[v].post)] = decoded_height_m(c.mesh, v);
  }
  std::vector<double> errors;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    errors.push_back(std::abs(surface[k] - static_cast<double>(c.heights_m[k])));
  }
  return errors;
}

TEST(TileError, AgreesWithBruteForceAndCountsValidPostsOnly) {
  for (std::uint64_t seed = 1; seed <= 16; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Case c = random_case(seed);
    const ErrorSummary summary = measure_error(c.grid, c.mesh, c.heights_m, c.valid);
    const auto errors = errors_slowly(c, Vertices::kWhereTheFilePutsThem);
    const auto in_place = errors_slowly(c, Vertices::kInPlace);
    ErrorSummary expected;
    for (std::size_t k = 0; k < kTilePostCount; ++k) {
      if (c.valid[k] == 0) continue;
      ++expected.posts;
      expected.sum_m += errors[k];
      expected.sum_of_squares_m2 += errors[k] * errors[k];
      expected.largest_m = std::max(expected.largest_m, errors[k]);
      expected.largest_in_place_m = std::max(expected.largest_in_place_m, in_place[k]);
    }
    ASSERT_EQ(summary.posts, expected.posts);
    ASSERT_NEAR(summary.largest_m, expected.largest_m, 1e-6);
    ASSERT_NEAR(summary.largest_in_place_m, expected.largest_in_place_m, 1e-6);
    ASSERT_NEAR(summary.mean_m(), expected.mean_m(), 1e-6);
    ASSERT_NEAR(summary.rms_m(), expected.rms_m(), 1e-6);
    const auto worst = static_cast<std::size_t>(tile_post_index(summary.worst.i, summary.worst.j));
    ASSERT_EQ(c.valid[worst], 1);
    ASSERT_NEAR(errors[worst], summary.largest_m, 1e-6);
  }
}

TEST(TileError, ATileWithoutValidPostsHasNoError) {
  Case c = random_case(2);
  std::fill(c.valid.begin(), c.valid.end(), std::uint8_t{0});
  const ErrorSummary summary = measure_error(c.grid, c.mesh, c.heights_m, c.valid);
  EXPECT_EQ(summary.posts, 0);
  EXPECT_EQ(summary.largest_m, 0);
  EXPECT_EQ(summary.mean_m(), 0);
  EXPECT_EQ(summary.rms_m(), 0);
}

TEST(TileError, UncoveredPostsAreNotCounted) {
  Case c = random_case(6);
  std::fill(c.valid.begin(), c.valid.end(), std::uint8_t{1});
  std::fill(c.heights_m.begin(), c.heights_m.end(), 0.0F);
  const auto whole = measure_error(c.grid, c.mesh, c.heights_m, c.valid);
  EXPECT_EQ(whole.posts, static_cast<std::int64_t>(kTilePostCount));
  c.mesh.indices.resize(c.mesh.indices.size() / 6 * 3);
  const auto part = measure_error(c.grid, c.mesh, c.heights_m, c.valid);
  EXPECT_LT(part.posts, whole.posts);
  EXPECT_GT(part.posts, 0);
}

TEST(TileError, SummariesAddUp) {
  ErrorSummary a = {.posts = 2,
                    .largest_m = 3,
                    .largest_in_place_m = 7,
                    .sum_m = 4,
                    .sum_of_squares_m2 = 10,
                    .worst = {1, 2}};
  const ErrorSummary b = {.posts = 1,
                          .largest_m = 5,
                          .largest_in_place_m = 6,
                          .sum_m = 5,
                          .sum_of_squares_m2 = 25,
                          .worst = {3, 4}};
  a.add(b);
  EXPECT_EQ(a.largest_in_place_m, 7);
  EXPECT_EQ(a.posts, 3);
  EXPECT_EQ(a.largest_m, 5);
  EXPECT_EQ(a.worst, (Post{3, 4}));
  EXPECT_EQ(a.mean_m(), 3);
  EXPECT_NEAR(a.rms_m(), std::sqrt(35.0 / 3), 1e-12);
}

// A cliff between two columns of posts: a vertex beside it stands up to half a unit from its post, and the
// surface at the post's own place is off by that share of the cliff.
TEST(TileError, OnSteepSlopesTheRoundingOfPlacesAddsToIt) {
  Case c;
  c.grid = make_tile_grid(TilingScheme(Projection::kGeodetic), {9, 500, 300});
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    c.heights_m.push_back(k % kTilePosts % 2 == 0 ? 0.0F : 8000.0F);
    c.valid.push_back(1);
  }
  c.tin = strip_ordered(
      greedy_insertion(c.grid, c.heights_m, {}, {.tolerance_m = 10, .height_steps = 0.5}));
  c.mesh = quantize(c.grid, c.tin, 0.5);
  const ErrorSummary summary = measure_error(c.grid, c.mesh, c.heights_m, c.valid);
  EXPECT_LE(summary.largest_m, 10);
  EXPECT_GT(summary.largest_in_place_m, 20);
  EXPECT_LE(summary.largest_in_place_m, 10 + 8000.0 / 127 / 2);
}

// The error against posts of a deeper zoom, found by trying every triangle.
ErrorSummary finer_error_slowly(const TilingScheme& scheme, const TileKey& key, const Case& c,
                                std::int32_t zoom, const PostWindow& window,
                                std::span<const float> heights_m) {
  const Lattice lattice(scheme, zoom);
  const std::int64_t side = std::int64_t{kTileIntervals} << (zoom - key.zoom);
  const double west_deg = lattice.longitude_deg(key.x * side);
  const double east_deg = lattice.longitude_deg((key.x + 1) * side);
  const double south_deg = lattice.latitude_deg(key.y * side);
  const double north_deg = lattice.latitude_deg((key.y + 1) * side);
  PostGrid places;
  places.width_posts = window.width_posts;
  places.height_posts = window.height_posts;
  for (std::int32_t i = 0; i < window.width_posts; ++i) {
    const double longitude_deg = lattice.longitude_deg(window.i0 + i);
    places.u_exact.push_back((longitude_deg - west_deg) / (east_deg - west_deg) * kQuantizedMax);
  }
  for (std::int32_t j = 0; j < window.height_posts; ++j) {
    const double latitude_deg = lattice.latitude_deg(window.j0 + j);
    places.v_exact.push_back((latitude_deg - south_deg) / (north_deg - south_deg) * kQuantizedMax);
  }
  const auto found = locate_posts_slowly(places, corners_of(c.tin), c.mesh.indices);
  ErrorSummary summary;
  for (std::size_t k = 0; k < found.size(); ++k) {
    if (std::isnan(heights_m[k])) continue;
    double surface_m = 0;
    for (std::size_t corner = 0; corner < 3; ++corner) {
      surface_m += found[k].weights[corner] *
                   decoded_height_m(c.mesh, c.mesh.indices[3 * found[k].triangle + corner]);
    }
    const double error_m = std::abs(surface_m - static_cast<double>(heights_m[k]));
    ++summary.posts;
    summary.sum_m += error_m;
    summary.sum_of_squares_m2 += error_m * error_m;
    summary.largest_m = std::max(summary.largest_m, error_m);
  }
  return summary;
}

TEST(FinerError, AgreesWithBruteForceInEveryWindowOfEitherScheme) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const Case c = random_case(seed);
    std::mt19937_64 random(seed);
    const TilingScheme scheme(seed % 2 == 0 ? Projection::kGeodetic : Projection::kMercator);
    const TileKey key = {2, 1, static_cast<std::int32_t>(random() % 4)};
    const TileSurface surface(scheme, key, c.mesh);
    const auto zoom = key.zoom + static_cast<std::int32_t>(random() % 5);
    const std::int64_t blocks = std::int64_t{1} << (zoom - key.zoom);
    const auto any = [&random](std::int64_t count) {
      return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(count));
    };
    const PostWindow window = {.i0 = (key.x * blocks + any(blocks)) * kTileIntervals,
                               .j0 = (key.y * blocks + any(blocks)) * kTileIntervals,
                               .width_posts = kTilePosts,
                               .height_posts = kTilePosts};
    std::vector<float> heights_m;
    for (std::size_t k = 0; k < window.size(); ++k) {
      heights_m.push_back(random() % 4 == 0 ? std::numeric_limits<float>::quiet_NaN()
                                            : static_cast<float>(random() % 3000));
    }
    const ErrorSummary found = surface.error(zoom, window, heights_m);
    const ErrorSummary expected = finer_error_slowly(scheme, key, c, zoom, window, heights_m);
    ASSERT_EQ(found.posts, expected.posts);
    ASSERT_NEAR(found.largest_m, expected.largest_m, 1e-5);
    ASSERT_EQ(found.largest_in_place_m, found.largest_m);
    ASSERT_NEAR(found.mean_m(), expected.mean_m(), 1e-5);
    ASSERT_NEAR(found.rms_m(), expected.rms_m(), 1e-5);
  }
}

}  // namespace
}  // namespace qmpipe::tile_error_test
