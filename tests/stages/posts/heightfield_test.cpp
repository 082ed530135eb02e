#include "stages/posts/heightfield.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <set>

#include "stages/posts/reduce.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::heightfield_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);
constexpr float kVoid = std::numeric_limits<float>::quiet_NaN();

bool same_bits(float a, float b) {
  return std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

std::int32_t below(std::mt19937_64& random, std::int32_t end) {
  return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
}

// Heights with patches of voids, straight from the seed.
float patchy_height_m(std::uint64_t seed, const Lattice& lattice, std::int64_t i, std::int64_t j) {
  const std::int64_t column = lattice.wrap_column(i);
  const bool is_hole =
      post_noise(seed + 1, column >> 4, j >> 4) < 0.4 || post_noise(seed + 2, column, j) < 0.02;
  return is_hole ? kVoid : globe_height_m(seed, lattice, column, j);
}

// Reduces all blocks that may hold data, zoom by zoom.
void reduce_all(LatticeStore& store, const TilingScheme& scheme, std::int32_t max_zoom,
                std::set<std::pair<std::int32_t, std::int32_t>> blocks) {
  std::vector<float> out(kBlockSize);
  for (std::int32_t zoom = max_zoom - 1; zoom >= 0; --zoom) {
    std::set<std::pair<std::int32_t, std::int32_t>> coarser;
    const std::int32_t columns = scheme.columns(zoom);
    for (const auto& [bx, by] : blocks) {
      for (std::int32_t k = 0; k < 9; ++k) {
        const std::int32_t x = ((bx + k % 3 - 1) >> 1) + columns;
        const std::int32_t y = (by + k / 3 - 1) >> 1;
        if (y >= 0 && y <= scheme.rows(zoom)) coarser.insert({x % columns, y});
      }
    }
    for (const auto& [bx, by] : coarser) {
      reduce_block(store, scheme, {.zoom = zoom, .x = bx, .y = by}, Reduction::kMean, out);
      store.put_block({.zoom = zoom, .x = bx, .y = by}, out);
    }
    blocks = coarser;
  }
}

struct World {
  TilingScheme scheme;
  std::int32_t max_zoom;
  std::unique_ptr<LatticeStore> store;
  std::vector<PoleHeights> poles;

  Heightfield heightfield(const VoidPolicy& policy) const {
    return Heightfield(*store, scheme, policy, poles);
  }
};

World make_patchy_world(std::uint64_t seed, const TilingScheme& scheme, std::int32_t max_zoom) {
  World world{scheme, max_zoom, make_memory_lattice_store(scheme, max_zoom), {}};
  const Lattice lattice(scheme, max_zoom);
  fill_zoom(*world.store, lattice,
            [&](std::int32_t i, std::int32_t j) { return patchy_height_m(seed, lattice, i, j); });
  std::set<std::pair<std::int32_t, std::int32_t>> blocks;
  for (std::int32_t by = 0; by <= scheme.rows(max_zoom); ++by) {
    for (std::int32_t bx = 0; bx < scheme.columns(max_zoom); ++bx) blocks.insert({bx, by});
  }
  reduce_all(*world.store, scheme, max_zoom, blocks);
  for (std::int32_t zoom = 0; zoom <= max_zoom; ++zoom) {
    world.poles.push_back({static_cast<float>(2000 + zoom), std::nullopt});
  }
  return world;
}

PostWindow random_window(std::mt19937_64& random, const Lattice& lattice) {
  const std::int32_t width = 2 + below(random, 70);
  const std::int32_t height = 2 + below(random, 70);
  const std::array<std::int64_t, 3> columns = {-30, lattice.columns() - 30, 400};
  const std::array<std::int64_t, 3> rows = {-1, lattice.rows() - height + 1, 200};
  return {.i0 = columns[random() % 3] + below(random, 30),
          .j0 = std::min(rows[random() % 3] + below(random, 20), lattice.rows() - height + 1),
          .width_posts = width,
          .height_posts = height};
}

TEST(Heightfield, WindowsAgreeOnEveryPostTheyShare) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const World world = make_patchy_world(3, scheme, 2);
    for (const auto kind : {VoidPolicy::Kind::kPull, VoidPolicy::Kind::kHeight}) {
      const Heightfield field = world.heightfield({.kind = kind, .base_height_m = 7});
      for (std::uint64_t seed = 1; seed <= 300; ++seed) {
        SCOPED_TRACE("seed " + std::to_string(seed));
        std::mt19937_64 random(seed);
        const std::int32_t zoom = static_cast<std::int32_t>(seed % 3);
        const Lattice lattice(scheme, zoom);
        const WindowHeights one = field.window(zoom, random_window(random, lattice));
        // A window of one post sees nothing around it.
        for (int k = 0; k < 60; ++k) {
          const std::int64_t i = one.window.i0 + below(random, one.window.width_posts);
          const std::int64_t j = one.window.j0 + below(random, one.window.height_posts);
          const std::int32_t turns = below(random, 3) - 1;
          const WindowHeights alone = field.window(zoom, {i + turns * lattice.columns(), j, 1, 1});
          ASSERT_TRUE(same_bits(one.height_m(i, j), alone.heights_m[0]))
              << zoom << " " << i << " " << j << ": " << one.height_m(i, j) << " and "
              << alone.heights_m[0];
          ASSERT_EQ(one.valid[one.index(i, j)], alone.valid[0]);
        }
      }
    }
  }
}

TEST(Heightfield, ValidPostsKeepTheirHeightsAndVoidsAreFinite) {
  const World world = make_patchy_world(5, kGeodetic, 2);
  const Lattice lattice(kGeodetic, 2);
  const Heightfield field = world.heightfield({});
  for (const std::int32_t y : {0, 2, 3}) {
    const WindowHeights heights = field.window(2, Lattice::tile_window({2, 7, y}, 1));
    const PostWindow& window = heights.window;
    for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
      for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i) {
        ASSERT_TRUE(std::isfinite(heights.height_m(i, j)));
        if (!lattice.has_row(j)) continue;
        const float stored_m = patchy_height_m(5, lattice, i, j);
        ASSERT_EQ(heights.valid[heights.index(i, j)], std::isnan(stored_m) ? 0 : 1);
        if (!std::isnan(stored_m) && !lattice.is_pole_row(j)) {
          ASSERT_TRUE(same_bits(heights.height_m(i, j), stored_m));
        }
      }
    }
  }
}

TEST(Heightfield, ThePlainPolicyPutsVoidsAtItsHeight) {
  const World world = make_patchy_world(6, kMercator, 1);
  const Lattice lattice(kMercator, 1);
  const Heightfield field =
      world.heightfield({.kind = VoidPolicy::Kind::kHeight, .base_height_m = -12.5});
  const WindowHeights heights = field.window(1, Lattice::tile_window({1, 0, 1}, 0));
  for (std::size_t k = 0; k < heights.heights_m.size(); ++k) {
    if (heights.valid[k] == 0) {
      ASSERT_EQ(heights.heights_m[k], -12.5F);
    }
  }
}

// With and without voids in the window: the pole is one point, whoever looks.
TEST(Heightfield, APoleRowHasOneHeight) {
  const auto store = make_memory_lattice_store(kGeodetic, 1);
  const Lattice lattice(kGeodetic, 1);
  fill_zoom(*store, lattice, [&](std::int32_t i, std::int32_t j) {
    return i > 600 && j < 9 ? kVoid : globe_height_m(1, lattice, i, j);
  });
  const std::vector<PoleHeights> poles = {{}, {77.0F, 88.0F}};
  const Heightfield field(*store, kGeodetic, {}, poles);
  for (std::int32_t k = 0; k < 8; ++k) {
    const std::int32_t x = k / 2;
    const std::int32_t halo = k % 2;
    const WindowHeights south = field.window(1, Lattice::tile_window({1, x, 0}, halo));
    const WindowHeights north = field.window(1, Lattice::tile_window({1, x, 1}, halo));
    for (std::int32_t i = x * 256 - halo; i <= x * 256 + 256 + halo; ++i) {
      ASSERT_EQ(south.height_m(i, 0), 77.0F) << i;
      ASSERT_EQ(north.height_m(i, lattice.rows() - 1), 88.0F) << i;
    }
  }
}

// One rectangle of data in a far larger void, at a zoom deep enough for all six levels.
struct Island {
  PostWindow data;
  World world;
};

template <class HeightOf>
Island make_island(std::mt19937_64& random, const HeightOf& height_of) {
  constexpr std::int32_t kZoom = 8;
  Island island{{}, {kGeodetic, kZoom, make_memory_lattice_store(kGeodetic, kZoom), {}}};
  island.world.poles.resize(kZoom + 1);
  const std::int32_t bx = 200;
  const std::int32_t by = 90;
  island.data = {bx * 256 + below(random, 120), by * 256 + below(random, 120),
                 8 + below(random, 120), 8 + below(random, 120)};
  std::vector<float> block(256 * 256, kVoid);
  for (std::int64_t j = island.data.j0; j < island.data.j0 + island.data.height_posts; ++j) {
    for (std::int64_t i = island.data.i0; i < island.data.i0 + island.data.width_posts; ++i) {
      block[static_cast<std::size_t>((j - by * 256) * 256 + i - bx * 256)] = height_of(i, j);
    }
  }
  island.world.store->put_block({.zoom = kZoom, .x = bx, .y = by}, block);
  reduce_all(*island.world.store, kGeodetic, kZoom, {{bx, by}});
  return island;
}

// Posts from the data's rectangle, in the larger direction.
std::int64_t distance_posts(const PostWindow& data, std::int64_t i, std::int64_t j) {
  const std::int64_t di =
      std::max({data.i0 - i, i - (data.i0 + data.width_posts - 1), std::int64_t{0}});
  const std::int64_t dj =
      std::max({data.j0 - j, j - (data.j0 + data.height_posts - 1), std::int64_t{0}});
  return std::max(di, dj);
}

TEST(Heightfield, PullFadesToTheBaseWithin128Posts) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const Island island = make_island(random, [](std::int64_t, std::int64_t) { return 1000.0F; });
    const Heightfield field = island.world.heightfield({.base_height_m = -200, .base_zoom = 2});
    const PostWindow& data = island.data;
    const WindowHeights heights = field.window(
        8, {data.i0 - 180, data.j0 - 180, data.width_posts + 360, data.height_posts + 360});
    const PostWindow& window = heights.window;
    for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
      for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i) {
        const std::int64_t distance = distance_posts(data, i, j);
        const float height_m = heights.height_m(i, j);
        ASSERT_TRUE(height_m >= -200.01F && height_m <= 1000.01F);
        if (distance == 0) {
          ASSERT_EQ(height_m, 1000.0F);
        }
        if (distance > 128) {
          ASSERT_EQ(height_m, -200.0F);
        }
      }
    }
    // Half way at 16 posts from the middle of a side at the earliest: a slope, no cliff.
    EXPECT_GT(heights.height_m(data.i0 - 8, data.j0 + data.height_posts / 2), 200.0F);
  }
}

// One surface: what is a void of both zooms has the coarser one's height.
TEST(Heightfield, VoidsBelowTheBaseZoomLieOnTheCoarserZoomsSurface) {
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    Island island = make_island(random, [&random](std::int64_t, std::int64_t) {
      return static_cast<float>(below(random, 4000));
    });
    island.world.poles.back()[1] = 55.0F;
    const std::int32_t base_zoom = below(random, 8);
    const Heightfield field =
        island.world.heightfield({.base_height_m = 10, .base_zoom = base_zoom});
    const std::int64_t north = Lattice(kGeodetic, 8).rows() - 1;
    std::int64_t compared = 0;
    std::int64_t i0 = island.data.i0 - 300;
    std::int64_t j0 = island.data.j0 - 300;
    for (std::int32_t zoom = 8; zoom > 0; --zoom, i0 >>= 1, j0 >>= 1) {
      const WindowHeights fine = field.window(zoom, {i0, j0, 700, 700});
      const WindowHeights coarse = field.window(zoom - 1, {i0 >> 1, j0 >> 1, 352, 352});
      for (std::int64_t j = j0 + (j0 & 1); j < j0 + 700; j += 2) {
        for (std::int64_t i = i0 + (i0 & 1); i < i0 + 700; i += 2) {
          if (fine.valid[fine.index(i, j)] != 0) continue;
          if (zoom <= base_zoom) {
            ASSERT_EQ(fine.height_m(i, j), 10.0F);
          } else {
            ASSERT_TRUE(same_bits(fine.height_m(i, j), coarse.height_m(i / 2, j / 2)))
                << zoom << " " << i << " " << j;
          }
          ++compared;
        }
      }
    }
    EXPECT_GT(compared, 100000);
    // The pole too.
    const float pole_m = field.window(8, {0, north, 1, 1}).heights_m[0];
    EXPECT_EQ(pole_m, 55.0F);
  }
}

// Level k of the pull is off by at most the slope over its 2^k posts and has half the weight of the
// level before it, so six levels add up to about six slopes; a sixty-fourth of the whole drop is
// left for the base, four times that at a corner.
TEST(Heightfield, PullHasNoJumpAtTheEdgeOfTheData) {
  for (std::uint64_t seed = 1; seed <= 24; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double slope_i = below(random, 21) - 10;
    const double slope_j = below(random, 21) - 10;
    const double slope = std::abs(slope_i) + std::abs(slope_j);
    Island island = make_island(random, [&](std::int64_t i, std::int64_t j) {
      return static_cast<float>(2000 + slope_i * static_cast<double>(i % 256 - 100) +
                                slope_j * static_cast<double>(j % 256 - 100));
    });
    const PostWindow& data = island.data;
    const Heightfield field = island.world.heightfield({.base_height_m = 0, .base_zoom = 2});
    const WindowHeights heights =
        field.window(8, {data.i0 - 2, data.j0 - 2, data.width_posts + 4, data.height_posts + 4});
    for (std::int64_t j = data.j0; j < data.j0 + data.height_posts; ++j) {
      for (std::int64_t i = data.i0; i < data.i0 + data.width_posts; ++i) {
        const double here_m = static_cast<double>(heights.height_m(i, j));
        for (std::int32_t k = 0; k < 9; ++k) {
          const double there_m =
              static_cast<double>(heights.height_m(i + k % 3 - 1, j + k / 3 - 1));
          ASSERT_LE(std::abs(there_m - here_m), 6 * slope + std::abs(here_m) / 16)
              << i - data.i0 << " " << j - data.j0 << " of " << data.width_posts << " x "
              << data.height_posts << ": " << here_m << " beside " << there_m;
        }
      }
    }
  }
}

TEST(MemoryLatticeStore, ReadsWhatWasWrittenAroundTheGlobe) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const auto store = make_memory_lattice_store(scheme, 1);
    const Lattice lattice(scheme, 1);
    fill_zoom(*store, lattice,
              [&](std::int32_t i, std::int32_t j) { return patchy_height_m(9, lattice, i, j); });
    for (std::uint64_t seed = 1; seed <= 100; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const PostWindow window = {below(random, 4000) - 2000, below(random, 700) - 100,
                                 1 + below(random, 600), 1 + below(random, 600)};
      std::vector<float> out(window.size(), -1.0F);
      store->read(lattice, window, out);
      std::size_t k = 0;
      for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
        for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i, ++k) {
          const float expected = lattice.has_row(j) ? patchy_height_m(9, lattice, i, j) : kVoid;
          ASSERT_TRUE(std::isnan(expected) ? std::isnan(out[k]) : same_bits(out[k], expected));
        }
      }
    }
  }
}

TEST(MemoryLatticeStore, BlocksOfVoidsTakeNoRoom) {
  const auto store = make_memory_lattice_store(kGeodetic, 0);
  const std::vector<float> voids(256 * 256, kVoid);
  const std::vector<float> sea(256 * 256, 0.0F);
  store->put_block({}, voids);
  EXPECT_FALSE(store->has_block({}));
  EXPECT_EQ(store->memory_bytes(), 0);
  store->put_block({.zoom = 0, .x = 1, .y = 0}, sea);
  EXPECT_TRUE(store->has_block({.zoom = 0, .x = 1, .y = 0}));
  EXPECT_EQ(store->memory_bytes(), 256 * 256 * 4);
}

}  // namespace
}  // namespace qmpipe::heightfield_test
