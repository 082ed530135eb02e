#include "stages/finish/normals.h"

#include <gtest/gtest.h>

#include <cmath>

#include "formats/tile/oct_normal.h"
#include "stages/surface/geodesy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::normals_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

std::unique_ptr<LatticeStore> rough_store(std::uint64_t seed, const TilingScheme& scheme,
                                          std::int32_t zoom) {
  auto store = make_memory_lattice_store(scheme, zoom);
  const Lattice lattice(scheme, zoom);
  fill_zoom(*store, lattice, [&](std::int32_t i, std::int32_t j) {
    return 40 * globe_height_m(seed, lattice, i, j);
  });
  return store;
}

TinVertex at_post(std::int32_t post) { return {.post = post}; }

std::vector<TinVertex> posts_of_side(Side side) {
  std::vector<TinVertex> vertices;
  for (std::int32_t k = 0; k < kTilePosts; ++k) {
    const Post p = side_post(side, k);
    vertices.push_back(at_post(tile_post_index(p.i, p.j)));
  }
  return vertices;
}

TEST(Normals, NeighboursWriteTheSameBytesAlongEveryBorder) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::int32_t zoom = 0; zoom <= 2; ++zoom) {
      const auto store = rough_store(4, scheme, zoom);
      const std::vector<PoleHeights> poles(3, PoleHeights{100.0F, 200.0F});
      const Heightfield field(*store, scheme, {}, poles);
      for (std::int32_t k = 0; k < scheme.columns(zoom) * scheme.rows(zoom); ++k) {
        const TileKey here = {zoom, k % scheme.columns(zoom), k / scheme.columns(zoom)};
        for (const Side side : {Side::kEast, Side::kNorth}) {
          const auto there = scheme.neighbour(here, side);
          if (!there) continue;
          const auto side_normals = [&](const TileKey& key, Side of) {
            return tile_normals(scheme, key, make_tile_grid(scheme, key),
                                field.window(zoom, Lattice::tile_window(key, 1)),
                                posts_of_side(of));
          };
          const auto ours = side_normals(here, side);
          const auto theirs = side_normals(*there, opposite(side));
          ASSERT_EQ(ours, theirs) << to_string(here) << " " << name_of(side);
        }
      }
    }
  }
}

// A plane of given slopes through a post, in the metres of its own east and north.
WindowHeights tilted_plane(const Lattice& lattice, const LatticePost& post, double slope_east,
                           double slope_north) {
  const double pi = std::acos(-1.0);
  const double lat = lattice.latitude_deg(post.j) * pi / 180;
  const double spacing = lattice.column_spacing_deg() * pi / 180;
  const double e2 = 6.69437999014e-3;
  const double w = 1 - e2 * std::sin(lat) * std::sin(lat);
  const double east_m = 6378137.0 / std::sqrt(w) * std::cos(lat) * std::sin(spacing);
  WindowHeights plane;
  plane.window = {post.i - 1, post.j - 1, 3, 3};
  plane.valid.assign(9, 1);
  for (std::int64_t j = post.j - 1; j <= post.j + 1; ++j) {
    for (std::int64_t i = post.i - 1; i <= post.i + 1; ++i) {
      const double d_lat = lattice.latitude_deg(j) * pi / 180 - lat;
      const double north_m = 6378137.0 * (1 - e2) / std::pow(w, 1.5) * d_lat;
      plane.heights_m.push_back(static_cast<float>(
          slope_east * east_m * static_cast<double>(i - post.i) + slope_north * north_m));
    }
  }
  return plane;
}

TEST(Normals, ATiltedPlaneHasItsSlopesInEastNorthUp) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const Lattice lattice(scheme, 13);
    for (std::uint64_t seed = 1; seed <= 300; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const LatticePost post = {
          static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(lattice.columns())),
          lattice.rows() / 10 + static_cast<std::int64_t>(
                                    random() % static_cast<std::uint64_t>(lattice.rows() * 4 / 5))};
      const double east = static_cast<double>(random() % 401) / 100 - 2;
      const double north = static_cast<double>(random() % 401) / 100 - 2;
      const Vec3 normal = lattice_normal(lattice, tilted_plane(lattice, post, east, north), post);
      const double lon_deg = lattice.longitude_deg(post.i);
      const Vec3 up = up_at(lon_deg, lattice.latitude_deg(post.j));
      const Vec3 to_east = up_at(lon_deg + 90, 0);
      const Vec3 to_north = cross(up, to_east);
      ASSERT_NEAR(length(normal), 1, 1e-12);
      // 1e-6 and what the curve of a meridian or a row spacing in the mercator scheme adds.
      const double bound = scheme.projection() == Projection::kGeodetic ? 1e-6 : 2e-5;
      ASSERT_NEAR(-dot(normal, to_east) / dot(normal, up), east, bound);
      ASSERT_NEAR(-dot(normal, to_north) / dot(normal, up), north, bound);
    }
  }
}

TEST(Normals, FlatGroundPointsUpAndPolesPointAlongTheAxis) {
  const auto store = make_memory_lattice_store(kGeodetic, 1);
  const Heightfield field(*store, kGeodetic, {}, std::vector<PoleHeights>(2));
  const Lattice lattice(kGeodetic, 1);
  for (const TileKey key : {TileKey{1, 0, 0}, TileKey{1, 3, 1}}) {
    const WindowHeights heights = field.window(1, Lattice::tile_window(key, 1));
    for (std::int32_t k = 0; k < kTilePosts; k += 16) {
      const LatticePost post = {key.x * 256 + k, key.y * 256 + (k * 7) % kTilePosts};
      const Vec3 up = up_at(lattice.longitude_deg(post.i), lattice.latitude_deg(post.j));
      ASSERT_GT(dot(lattice_normal(lattice, heights, post), up), 1 - 1e-9);
      const std::int64_t pole = key.y == 0 ? 0 : lattice.rows() - 1;
      ASSERT_EQ(lattice_normal(lattice, heights, {post.i, pole}),
                (Vec3{0, 0, key.y == 0 ? -1.0 : 1.0}));
    }
  }
}

TEST(Normals, BytesAreTheEncodedLatticeNormalsInTheOrderAsked) {
  const auto store = rough_store(8, kMercator, 1);
  const Heightfield field(*store, kMercator, {}, {});
  const TileKey key = {1, 1, 1};
  const WindowHeights heights = field.window(1, Lattice::tile_window(key, 1));
  const std::vector<TinVertex> vertices = {at_post(tile_post_index(256, 256)),
                                           at_post(tile_post_index(3, 9)),
                                           at_post(tile_post_index(0, 128))};
  const PostGrid grid = make_tile_grid(kMercator, key);
  const auto normals = tile_normals(kMercator, key, grid, heights, vertices);
  ASSERT_EQ(normals.size(), vertices.size());
  for (std::size_t k = 0; k < vertices.size(); ++k) {
    const LatticePost post = {256 + grid.column(vertices[k].post),
                              256 + grid.row(vertices[k].post)};
    EXPECT_EQ(normals[k], encode_oct_normal(lattice_normal(Lattice(kMercator, 1), heights, post)));
  }
}

TEST(Normals, AVertexBetweenPostsLooksTheWayOfTheFourAroundIt) {
  const auto store = rough_store(9, kMercator, 1);
  const Heightfield field(*store, kMercator, {}, {});
  const TileKey key = {1, 1, 1};
  const WindowHeights heights = field.window(1, Lattice::tile_window(key, 1));
  const PostGrid grid = make_tile_grid(kMercator, key);
  const auto normal = [&](std::int32_t i, std::int32_t j) {
    return lattice_normal(Lattice(kMercator, 1), heights, {256 + i, 256 + j});
  };
  const auto near = [&](std::int32_t u, std::int32_t v, const Vec3& expected) {
    const TinVertex vertex = {.u = u, .v = v};
    const auto normals = tile_normals(kMercator, key, grid, heights, {&vertex, 1});
    const Vec3 got = decode_oct_normal(normals.at(0));
    EXPECT_GT(dot(got, expected), 0.9998) << u << " " << v;
  };
  near(grid.u[100], grid.v[50], normal(100, 50));
  near(grid.u[100] + 64, grid.v[50], unit(plus(normal(100, 50), normal(101, 50))));
  near(grid.u[7], (grid.v[30] + grid.v[31]) / 2, unit(plus(normal(7, 30), normal(7, 31))));
  near(32766, 32766, normal(256, 256));
}

}  // namespace
}  // namespace qmpipe::normals_test
