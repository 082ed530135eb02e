#include "stages/posts/reduce.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "tests/support/terrain_fixture.h"

namespace qmpipe::reduce_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);
constexpr float kVoid = std::numeric_limits<float>::quiet_NaN();
constexpr std::array kReductions = {Reduction::kMean, Reduction::kSubsample, Reduction::kMax,
                                    Reduction::kMin};

float fine_height_m(std::uint64_t seed, const Lattice& lattice, std::int64_t i, std::int64_t j) {
  if (!lattice.has_row(j)) return kVoid;
  const std::int64_t column = lattice.wrap_column(i);
  const double share = seed % 2 == 0 ? 0.3 : 0.85;
  if (post_noise(seed + 1, column, j) < share) return kVoid;
  return globe_height_m(seed, lattice, column, j);
}

struct Counted {
  double height_m;
  int weight;
};

// The definition written down anew: collect the valid posts around, then reduce them.
float reduced_slowly(const std::vector<Counted>& posts, Reduction reduction) {
  if (posts.empty()) return kVoid;
  double sum = 0;
  int weight = 0;
  double high = posts[0].height_m;
  double low = posts[0].height_m;
  for (const Counted& post : posts) {
    sum += post.weight * post.height_m;
    weight += post.weight;
    high = std::max(high, post.height_m);
    low = std::min(low, post.height_m);
  }
  if (reduction == Reduction::kMax) return static_cast<float>(high);
  if (reduction == Reduction::kMin) return static_cast<float>(low);
  return static_cast<float>(sum / weight);
}

float expected_height_m(std::uint64_t seed, const Lattice& fine, std::int32_t i, std::int32_t j,
                        Reduction reduction) {
  if (reduction == Reduction::kSubsample) return fine_height_m(seed, fine, 2 * i, 2 * j);
  std::vector<Counted> posts;
  for (std::int32_t dj = -1; dj <= 1; ++dj) {
    for (std::int32_t di = -1; di <= 1; ++di) {
      const float height_m = fine_height_m(seed, fine, 2 * i + di, 2 * j + dj);
      if (std::isnan(height_m)) continue;
      posts.push_back({static_cast<double>(height_m), (di == 0 ? 2 : 1) * (dj == 0 ? 2 : 1)});
    }
  }
  return reduced_slowly(posts, reduction);
}

void expect_zoom_reduced(std::uint64_t seed, const TilingScheme& scheme, std::int32_t zoom,
                         Reduction reduction) {
  const Lattice fine(scheme, zoom + 1);
  const Lattice coarse(scheme, zoom);
  const auto store = make_memory_lattice_store(scheme, zoom + 1);
  fill_zoom(*store, fine,
            [&](std::int32_t i, std::int32_t j) { return fine_height_m(seed, fine, i, j); });
  std::vector<float> out(256 * 256, -1.0F);
  for (std::int32_t by = 0; by <= scheme.rows(zoom); ++by) {
    for (std::int32_t bx = 0; bx < scheme.columns(zoom); ++bx) {
      reduce_block(*store, scheme, {.zoom = zoom, .x = bx, .y = by}, reduction, out);
      for (std::int32_t k = 0; k < 256 * 256; ++k) {
        const std::int32_t i = bx * 256 + k % 256;
        const std::int32_t j = by * 256 + k / 256;
        const float expected =
            coarse.has_row(j) ? expected_height_m(seed, fine, i, j, reduction) : kVoid;
        const float got = out[static_cast<std::size_t>(k)];
        ASSERT_TRUE(std::isnan(expected) ? std::isnan(got) : got == expected)
            << i << " " << j << ": " << got << " instead of " << expected;
      }
    }
  }
}

class ReduceBy : public ::testing::TestWithParam<Reduction> {};

TEST_P(ReduceBy, EqualsItsDefinitionWithVoidsAroundTheGlobe) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    expect_zoom_reduced(seed, kGeodetic, 0, GetParam());
    expect_zoom_reduced(seed, kMercator, 0, GetParam());
  }
}

TEST_P(ReduceBy, AConstantStaysItselfAndVoidsStayVoid) {
  const auto store = make_memory_lattice_store(kGeodetic, 1);
  const Lattice fine(kGeodetic, 1);
  std::vector<float> out(256 * 256);
  reduce_block(*store, kGeodetic, {.zoom = 0, .x = 1, .y = 0}, GetParam(), out);
  EXPECT_TRUE(std::all_of(out.begin(), out.end(), [](float h) { return std::isnan(h); }));
  fill_zoom(*store, fine, [](std::int32_t, std::int32_t) { return -4321.5F; });
  reduce_block(*store, kGeodetic, {.zoom = 0, .x = 1, .y = 0}, GetParam(), out);
  EXPECT_TRUE(std::all_of(out.begin(), out.end(), [](float h) { return h == -4321.5F; }));
}

INSTANTIATE_TEST_SUITE_P(All, ReduceBy, ::testing::ValuesIn(kReductions));

TEST(Reduce, MaximumIsAboveMeanIsAboveMinimum) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const auto store = make_memory_lattice_store(kGeodetic, 1);
    const Lattice fine(kGeodetic, 1);
    fill_zoom(*store, fine,
              [&](std::int32_t i, std::int32_t j) { return fine_height_m(seed, fine, i, j); });
    std::array<std::vector<float>, 4> out;
    for (std::size_t k = 0; k < 4; ++k) {
      out[k].resize(256 * 256);
      reduce_block(*store, kGeodetic, {}, kReductions[k], out[k]);
    }
    for (std::size_t k = 0; k < out[0].size(); ++k) {
      if (std::isnan(out[0][k])) continue;
      ASSERT_LE(out[0][k], out[2][k]);
      ASSERT_GE(out[0][k], out[3][k]);
      if (!std::isnan(out[1][k])) {
        ASSERT_LE(out[1][k], out[2][k]);
        ASSERT_GE(out[1][k], out[3][k]);
      }
    }
  }
}

}  // namespace
}  // namespace qmpipe::reduce_test
