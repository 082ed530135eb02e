#include "scheduler/tiling_scheme.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <random>
#include <set>

#include "scheduler/lattice.h"

namespace qmpipe::tiling_test {
namespace {

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

TileKey random_key(std::mt19937_64& random, const TilingScheme& scheme, std::int32_t zoom) {
  const auto below = [&random](std::int32_t end) {
    return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
  };
  return {.zoom = zoom, .x = below(scheme.columns(zoom)), .y = below(scheme.rows(zoom))};
}

bool same_bits(double a, double b) {
  return std::bit_cast<std::uint64_t>(a) == std::bit_cast<std::uint64_t>(b);
}

TEST(TileKey, OrdersByZoomThenRowThenColumn) {
  std::mt19937_64 random(1);
  std::vector<TileKey> keys;
  for (int k = 0; k < 500; ++k) {
    keys.push_back({.zoom = static_cast<std::int32_t>(random() % 3),
                    .x = static_cast<std::int32_t>(random() % 8),
                    .y = static_cast<std::int32_t>(random() % 8)});
  }
  std::sort(keys.begin(), keys.end());
  for (std::size_t k = 1; k < keys.size(); ++k) {
    const TileKey& a = keys[k - 1];
    const TileKey& b = keys[k];
    const bool in_order = a.zoom != b.zoom ? a.zoom < b.zoom : a.y != b.y ? a.y < b.y : a.x <= b.x;
    ASSERT_TRUE(in_order) << to_string(a) << " before " << to_string(b);
  }
}

TEST(TileKey, PackedWordsDifferAndHoldTheKeyUpToTheDeepestZoom) {
  std::mt19937_64 random(2);
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    std::set<std::uint64_t> words;
    std::set<TileKey> keys;
    for (std::int32_t zoom = 0; zoom <= kMaxZoom; ++zoom) {
      const TileKey last = {zoom, scheme.columns(zoom) - 1, scheme.rows(zoom) - 1};
      for (int k = 0; k < 200; ++k) {
        const TileKey key = k == 0 ? last : random_key(random, scheme, zoom);
        const std::uint64_t word = packed(key);
        ASSERT_EQ(word >> 58U, static_cast<std::uint64_t>(key.zoom));
        ASSERT_EQ((word >> 29U) & ((1U << 29U) - 1), static_cast<std::uint64_t>(key.y));
        ASSERT_EQ(word & ((1U << 29U) - 1), static_cast<std::uint64_t>(key.x));
        words.insert(word);
        keys.insert(key);
      }
    }
    EXPECT_EQ(words.size(), keys.size());
  }
}

TEST(TileKey, ParentHoldsItsFourChildren) {
  std::mt19937_64 random(3);
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (int k = 0; k < 300; ++k) {
      const TileKey child =
          random_key(random, scheme, 1 + static_cast<std::int32_t>(random() % 12));
      const RectangleDeg inner = scheme.rectangle_deg(child);
      const RectangleDeg outer = scheme.rectangle_deg(parent_of(child));
      ASSERT_TRUE(outer.west_deg <= inner.west_deg && inner.east_deg <= outer.east_deg);
      ASSERT_TRUE(outer.south_deg <= inner.south_deg && inner.north_deg <= outer.north_deg);
    }
  }
}

TEST(TilingScheme, RootsCoverTheirSquareOfTheGlobe) {
  EXPECT_EQ(kGeodetic.roots(), (std::vector<TileKey>{{0, 0, 0}, {0, 1, 0}}));
  EXPECT_EQ(kMercator.roots(), (std::vector<TileKey>{{0, 0, 0}}));
  EXPECT_EQ(kGeodetic.rectangle_deg({0, 0, 0}), (RectangleDeg{-180, -90, 0, 90}));
  EXPECT_EQ(kGeodetic.rectangle_deg({0, 1, 0}), (RectangleDeg{0, -90, 180, 90}));
  EXPECT_EQ(kGeodetic.rectangle_deg({1, 3, 1}), (RectangleDeg{90, 0, 180, 90}));
  const RectangleDeg root = kMercator.rectangle_deg({0, 0, 0});
  EXPECT_EQ(root.west_deg, -180);
  EXPECT_EQ(root.east_deg, 180);
  EXPECT_NEAR(root.north_deg, 85.05112877980659, 1e-12);
  EXPECT_EQ(root.south_deg, -root.north_deg);
}

// EPSG:3857 written down on its own: metres on the plane, then back to degrees.
TEST(TilingScheme, MercatorRowsAreEqualSpacesOnTheWebMercatorPlane) {
  constexpr double kRadius = 6378137.0;
  const double pi = std::acos(-1.0);
  for (std::int32_t zoom = 0; zoom <= 12; ++zoom) {
    for (std::int32_t y = 0; y < kMercator.rows(zoom);
         y += std::max(1, kMercator.rows(zoom) / 16)) {
      const RectangleDeg rectangle = kMercator.rectangle_deg({zoom, 0, y});
      const double northing = -pi * kRadius + 2 * pi * kRadius * y / kMercator.rows(zoom);
      const double south = 2 * std::atan(std::exp(northing / kRadius)) - pi / 2;
      ASSERT_NEAR(rectangle.south_deg, south * 180 / pi, 1e-11) << zoom << " " << y;
    }
  }
}

TEST(TilingScheme, ContainsExactlyTheKeysOfThePyramid) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (const std::int32_t zoom : {0, 1, 5, kMaxZoom}) {
      const std::int32_t columns = scheme.columns(zoom);
      const std::int32_t rows = scheme.rows(zoom);
      EXPECT_TRUE(scheme.contains({zoom, columns - 1, rows - 1}));
      EXPECT_FALSE(scheme.contains({zoom, columns, 0}));
      EXPECT_FALSE(scheme.contains({zoom, 0, rows}));
      EXPECT_FALSE(scheme.contains({zoom, -1, 0}));
      EXPECT_FALSE(scheme.contains({zoom, 0, -1}));
    }
    EXPECT_FALSE(scheme.contains({-1, 0, 0}));
    EXPECT_FALSE(scheme.contains({kMaxZoom + 1, 0, 0}));
    EXPECT_EQ(scheme.columns(7), scheme.columns(0) * 128);
  }
}

TEST(TilingScheme, NeighboursShareTheSideAndLeadBack) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::uint64_t seed = 1; seed <= 2000; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const TileKey key = random_key(random, scheme, static_cast<std::int32_t>(seed % 15));
      const RectangleDeg here = scheme.rectangle_deg(key);
      for (const Side side : kSides) {
        const auto other = scheme.neighbour(key, side);
        const bool beyond_pole = (side == Side::kSouth && key.y == 0) ||
                                 (side == Side::kNorth && key.y == scheme.rows(key.zoom) - 1);
        ASSERT_EQ(other.has_value(), !beyond_pole);
        if (!other) continue;
        ASSERT_EQ(scheme.neighbour(*other, opposite(side)), key);
        const RectangleDeg there = scheme.rectangle_deg(*other);
        if (side == Side::kEast) {
          const double east_deg = here.east_deg == 180 ? -180 : here.east_deg;
          ASSERT_TRUE(same_bits(east_deg, there.west_deg));
          ASSERT_TRUE(same_bits(here.south_deg, there.south_deg));
        }
        if (side == Side::kNorth) {
          ASSERT_TRUE(same_bits(here.north_deg, there.south_deg));
          ASSERT_TRUE(same_bits(here.west_deg, there.west_deg));
        }
      }
    }
  }
}

TEST(TilingScheme, ColumnsWrapAtTheAntimeridian) {
  EXPECT_EQ(kGeodetic.neighbour({0, 0, 0}, Side::kWest), (TileKey{0, 1, 0}));
  EXPECT_EQ(kGeodetic.neighbour({0, 0, 0}, Side::kEast), (TileKey{0, 1, 0}));
  EXPECT_EQ(kGeodetic.neighbour({3, 15, 2}, Side::kEast), (TileKey{3, 0, 2}));
  EXPECT_EQ(kMercator.neighbour({0, 0, 0}, Side::kWest), (TileKey{0, 0, 0}));
  EXPECT_EQ(kMercator.neighbour({0, 0, 0}, Side::kEast), (TileKey{0, 0, 0}));
  EXPECT_EQ(kMercator.neighbour({2, 0, 1}, Side::kWest), (TileKey{2, 3, 1}));
}

TEST(Lattice, APostHasTheSameCoordinatesInEveryZoomBitForBit) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    std::mt19937_64 random(5);
    for (std::int32_t zoom = 0; zoom < kMaxZoom; ++zoom) {
      const Lattice coarse(scheme, zoom);
      const Lattice fine(scheme, zoom + 1);
      ASSERT_EQ(fine.columns(), 2 * coarse.columns());
      ASSERT_EQ(fine.rows(), 2 * coarse.rows() - 1);
      for (int k = 0; k < 2000; ++k) {
        const auto i = static_cast<std::int64_t>(
            random() % (static_cast<std::uint64_t>(coarse.columns()) + 1));
        const auto j =
            static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(coarse.rows()));
        ASSERT_TRUE(same_bits(coarse.longitude_deg(i), fine.longitude_deg(2 * i))) << zoom;
        ASSERT_TRUE(same_bits(coarse.latitude_deg(j), fine.latitude_deg(2 * j))) << zoom;
      }
    }
  }
}

TEST(Lattice, CoordinatesAscendAndEndAtTheSchemesLimits) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (const std::int32_t zoom : {0, 3, kMaxZoom}) {
      const Lattice lattice(scheme, zoom);
      const double limit_deg = scheme.rectangle_deg(scheme.roots()[0]).north_deg;
      EXPECT_EQ(lattice.longitude_deg(0), -180);
      EXPECT_EQ(lattice.longitude_deg(lattice.columns()), 180);
      EXPECT_EQ(lattice.longitude_deg(lattice.columns() / 2), 0);
      EXPECT_EQ(lattice.latitude_deg(0), -limit_deg);
      EXPECT_EQ(lattice.latitude_deg(lattice.rows() - 1), limit_deg);
      EXPECT_EQ(lattice.latitude_deg((lattice.rows() - 1) / 2), 0);
      for (std::int32_t k = 1; k <= 256; ++k) {
        const std::int64_t j = lattice.rows() - 1 - k;
        ASSERT_LT(lattice.latitude_deg(j), lattice.latitude_deg(j + 1));
        ASSERT_EQ(lattice.latitude_deg(k), -lattice.latitude_deg(j));
        ASSERT_LT(lattice.longitude_deg(k - 1), lattice.longitude_deg(k));
      }
    }
  }
}

TEST(Lattice, TheDeepestZoomHasAllItsPosts) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    const std::int64_t columns = (std::int64_t{scheme.columns(0)} << kMaxZoom) * kTileIntervals;
    ASSERT_GT(columns, std::int64_t{std::numeric_limits<std::int32_t>::max()});
    const Lattice lattice(scheme, kMaxZoom);
    EXPECT_EQ(lattice.columns(), columns);
    const TileKey last = {kMaxZoom, scheme.columns(kMaxZoom) - 1, scheme.rows(kMaxZoom) - 1};
    const PostWindow window = Lattice::tile_window(last, 1);
    EXPECT_EQ(window.i0 + window.width_posts, lattice.columns() + 2);
    EXPECT_EQ(window.j0 + window.height_posts, lattice.rows() + 1);
    EXPECT_EQ(lattice.wrap_column(window.i0 + window.width_posts - 1), 1);
    EXPECT_EQ(lattice.wrap_column(-1), columns - 1);
    EXPECT_EQ(lattice.wrap_column(-3 * columns - 2), columns - 2);
  }
}

// A tile's corners are the lattice's, columns and rows lead back to themselves, and neighbours share
// their sides: where posts are 5 mm apart, doubles must not run out of digits.
TEST(Lattice, PostsOfDeepZoomsAreToldApart) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::uint64_t seed = 1; seed <= 500; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const std::int32_t zoom = kMaxZoom - static_cast<std::int32_t>(seed % 4);
      const Lattice lattice(scheme, zoom);
      const TileKey key = random_key(random, scheme, zoom);
      const PostWindow window = Lattice::tile_window(key, 0);
      const RectangleDeg rectangle = scheme.rectangle_deg(key);
      ASSERT_TRUE(same_bits(lattice.longitude_deg(window.i0), rectangle.west_deg));
      ASSERT_TRUE(same_bits(lattice.longitude_deg(window.i0 + 256), rectangle.east_deg));
      ASSERT_TRUE(same_bits(lattice.latitude_deg(window.j0), rectangle.south_deg));
      ASSERT_TRUE(same_bits(lattice.latitude_deg(window.j0 + 256), rectangle.north_deg));
      ASSERT_NEAR(rectangle.east_deg - rectangle.west_deg, 256 * lattice.column_spacing_deg(),
                  1e-12);
      for (std::int32_t k = 0; k < 256; ++k) {
        const std::int64_t i = window.i0 + k;
        const std::int64_t j = window.j0 + k;
        ASSERT_EQ(std::llround(lattice.column_at(lattice.longitude_deg(i))), i);
        ASSERT_EQ(std::llround(lattice.row_at(lattice.latitude_deg(j))), j);
        // Steps differ by no more than a hundredth of one from what they are on the globe.
        const double step_deg = lattice.latitude_deg(j + 1) - lattice.latitude_deg(j);
        const double whole_deg = (rectangle.north_deg - rectangle.south_deg) / 256;
        ASSERT_NEAR(step_deg / whole_deg, 1, 0.01);
      }
    }
  }
}

TEST(Lattice, WrapColumnIsTheRemainder) {
  const Lattice lattice(kGeodetic, 0);
  ASSERT_EQ(lattice.columns(), 512);
  for (std::int32_t i = -2000; i <= 2000; ++i) {
    const std::int64_t wrapped = lattice.wrap_column(i);
    ASSERT_TRUE(wrapped >= 0 && wrapped < 512);
    ASSERT_EQ((wrapped - i) % 512, 0);
  }
}

TEST(Lattice, ColumnAtAndRowAtInvertTheCoordinates) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (const std::int32_t zoom : {0, 5, 14}) {
      const Lattice lattice(scheme, zoom);
      for (std::int32_t k = 0; k <= 64; ++k) {
        const std::int64_t i = lattice.columns() / 64 * k;
        const std::int64_t j = (lattice.rows() - 1) / 64 * k;
        ASSERT_NEAR(lattice.column_at(lattice.longitude_deg(i)), static_cast<double>(i), 1e-6);
        ASSERT_NEAR(lattice.row_at(lattice.latitude_deg(j)), static_cast<double>(j), 1e-6);
      }
      ASSERT_NEAR(lattice.row_at(90), static_cast<double>(lattice.rows() - 1), 1e-6);
    }
  }
}

TEST(Lattice, OnlyTheGeodeticEndRowsArePoles) {
  for (const std::int32_t zoom : {0, 4}) {
    const Lattice geodetic(kGeodetic, zoom);
    const Lattice mercator(kMercator, zoom);
    for (std::int32_t j = -1; j <= geodetic.rows(); ++j) {
      const bool is_end = j == 0 || j == geodetic.rows() - 1;
      ASSERT_EQ(geodetic.is_pole_row(j), is_end);
      ASSERT_FALSE(mercator.is_pole_row(j));
      ASSERT_EQ(geodetic.has_row(j), j >= 0 && j <= geodetic.rows() - 1);
    }
    EXPECT_EQ(geodetic.latitude_deg(0), -90);
    EXPECT_EQ(geodetic.latitude_deg(geodetic.rows() - 1), 90);
  }
}

TEST(Lattice, NeighbouringTileWindowsShareTheirSide) {
  const PostWindow here = Lattice::tile_window({4, 5, 6}, 0);
  const PostWindow east = Lattice::tile_window({4, 6, 6}, 0);
  const PostWindow north = Lattice::tile_window({4, 5, 7}, 0);
  EXPECT_EQ(here.width_posts, 257);
  EXPECT_EQ(here.height_posts, 257);
  EXPECT_EQ(here.i0 + here.width_posts - 1, east.i0);
  EXPECT_EQ(here.j0 + here.height_posts - 1, north.j0);
  EXPECT_EQ(Lattice::tile_window({4, 5, 6}, 3), (PostWindow{here.i0 - 3, here.j0 - 3, 263, 263}));
}

}  // namespace
}  // namespace qmpipe::tiling_test
