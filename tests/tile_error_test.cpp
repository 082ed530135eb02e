#include "stages/tile_error.h"

#include <gtest/gtest.h>

#include <cmath>

#include "stages/greedy.h"
#include "stages/mesh_order.h"
#include "stages/quantize.h"
#include "tests/terrain_fixture.h"

namespace qmpipe {
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

// Decoded heights interpolated at exact places; a vertex where the file puts it.
std::vector<double> errors_slowly(const Case& c) {
  const auto places = locate_posts_slowly(c.grid, corners_of(c.tin), c.mesh.indices);
  std::vector<double> surface(kTilePostCount, 0);
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    for (std::size_t corner = 0; corner < 3; ++corner) {
      surface[k] += places[k].weights[corner] *
                    decoded_height_m(c.mesh, c.mesh.indices[3 * places[k].triangle + corner]);
    }
  }
  for (std::size_t v = 0; v < c.tin.vertices.size(); ++v) {
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
    const auto errors = errors_slowly(c);
    ErrorSummary expected;
    for (std::size_t k = 0; k < kTilePostCount; ++k) {
      if (c.valid[k] == 0) continue;
      ++expected.posts;
      expected.sum_m += errors[k];
      expected.sum_of_squares_m2 += errors[k] * errors[k];
      expected.largest_m = std::max(expected.largest_m, errors[k]);
    }
    ASSERT_EQ(summary.posts, expected.posts);
    ASSERT_NEAR(summary.largest_m, expected.largest_m, 1e-6);
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
  ErrorSummary a = {
      .posts = 2, .largest_m = 3, .sum_m = 4, .sum_of_squares_m2 = 10, .worst = {1, 2}};
  const ErrorSummary b = {
      .posts = 1, .largest_m = 5, .sum_m = 5, .sum_of_squares_m2 = 25, .worst = {3, 4}};
  a.add(b);
  EXPECT_EQ(a.posts, 3);
  EXPECT_EQ(a.largest_m, 5);
  EXPECT_EQ(a.worst, (Post{3, 4}));
  EXPECT_EQ(a.mean_m(), 3);
  EXPECT_NEAR(a.rms_m(), std::sqrt(35.0 / 3), 1e-12);
}

}  // namespace
}  // namespace qmpipe
