#include "stages/posts/sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "stages/posts/post_positions.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::sampling_test {
namespace {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
const TilingScheme kGeodetic(Projection::kGeodetic);

Sampler sampler_of(const std::vector<std::string>& paths,
                   Resampling resampling = Resampling::kBilinear) {
  return {pool_of(paths), resampling};
}

std::vector<float> sampled(Sampler& sampler, const Lattice& lattice, const PostWindow& window) {
  std::vector<float> heights(window.size());
  sampler.sample(lattice, window, heights);
  return heights;
}

bool same_bits(float a, float b) { return a == b || (std::isnan(a) && std::isnan(b)); }

// The window of posts around a place.
PostWindow around(const Lattice& lattice, double longitude_deg, double latitude_deg, int width,
                  int height) {
  const double spacing = lattice.column_spacing_deg();
  return {.i0 = static_cast<std::int64_t>(std::floor((longitude_deg + 180) / spacing)) - width / 2,
          .j0 = static_cast<std::int64_t>(std::floor((latitude_deg + 90) / spacing)) - height / 2,
          .width_posts = width,
          .height_posts = height};
}

// Posts of zoom 0 are 0.703125 degrees apart; pixels of a quarter of that.
constexpr double kQuarter = 0.703125 / 4;

RasterFixture plane_in_degrees() {
  RasterFixture fixture{.width = 60, .height = 50, .type = "Float64"};
  fixture.geotransform = {{10.02, kQuarter, 0, 52.3, 0, -kQuarter}};
  fixture.value = [](int c, int r) {
    return 100 + 3 * (10.02 + (c + 0.5) * kQuarter) - 2 * (52.3 - (r + 0.5) * kQuarter);
  };
  return fixture;
}

TEST(Sampling, ReproducesAPlaneInDegrees) {
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "plane.tif");
  write_raster(path, plane_in_degrees());
  for (const Resampling resampling : {Resampling::kBilinear, Resampling::kCubic}) {
    Sampler sampler = sampler_of({path}, resampling);
    const Lattice lattice(kGeodetic, 3);
    const PostWindow window = around(lattice, 15, 48, 80, 60);
    const std::vector<float> heights = sampled(sampler, lattice, window);
    std::size_t k = 0;
    for (int j = 0; j < window.height_posts; ++j) {
      for (int i = 0; i < window.width_posts; ++i, ++k) {
        const double lon = lattice.longitude_deg(window.i0 + i);
        const double lat = lattice.latitude_deg(window.j0 + j);
        // Inside by two pixels: nearer to the edge the outermost pixels are repeated.
        if (lon < 10.4 || lon > 20.2 || lat < 43.9 || lat > 51.9) continue;
        ASSERT_NEAR(heights[k], static_cast<float>(100 + 3 * lon - 2 * lat), 1e-4);
      }
    }
  }
}

TEST(Sampling, PlacesInUtmAreExactToAHundredthOfAPixel) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 400, .height = 300};
  fixture.crs = "EPSG:32631";
  for (const double pixel_m : {30.0, 1000.0, 5000.0}) {
    SCOPED_TRACE(pixel_m);
    fixture.geotransform = {{600000, pixel_m, 0, 5000000, 0, -pixel_m}};
    const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
    const Lattice lattice(kGeodetic, sampling_zoom_for(kGeodetic, std::span(&source->info(), 1)));
    const RectangleDeg bounds = source->info().bounds_deg;
    const PostWindow window = around(lattice, (bounds.west_deg + bounds.east_deg) / 2,
                                     (bounds.south_deg + bounds.north_deg) / 2, 150, 130);
    std::vector<PixelPoint> places(window.size());
    locate_posts(source->grid(), lattice, window, places);
    for (std::size_t k = 0; k < places.size(); k += 7) {
      const auto i = window.i0 + static_cast<int>(k) % window.width_posts;
      const auto j = window.j0 + static_cast<int>(k) / window.width_posts;
      const auto exact = source->pixel_at(lattice.longitude_deg(i), lattice.latitude_deg(j));
      ASSERT_TRUE(exact);
      ASSERT_NEAR(places[k].column, exact->column, kPositionTolerancePixels);
      ASSERT_NEAR(places[k].row, exact->row, kPositionTolerancePixels);
    }
  }
}

TEST(Sampling, EveryPostOnTheRasterHasAHeight) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 200, .height = 150};
  fixture.crs = "EPSG:32631";
  fixture.geotransform = {{600000, 90, 0, 5000000, 0, -90}};
  const std::string path = file_in(folder, "a.tif");
  const auto source = open_fixture(path, fixture);
  Sampler sampler = sampler_of({path});
  const Lattice lattice(kGeodetic, 10);
  const PostWindow window = around(lattice, 4.4, 45.1, 500, 400);
  const std::vector<float> heights = sampled(sampler, lattice, window);
  for (std::size_t k = 0; k < heights.size(); ++k) {
    const auto i = window.i0 + static_cast<int>(k) % window.width_posts;
    const auto j = window.j0 + static_cast<int>(k) / window.width_posts;
    const auto at = source->pixel_at(lattice.longitude_deg(i), lattice.latitude_deg(j)).value();
    const double inside =
        std::min(std::min(at.column, 200 - at.column), std::min(at.row, 150 - at.row));
    if (std::abs(inside) < 0.02) continue;
    ASSERT_EQ(!std::isnan(heights[k]), inside > 0) << at.column << ' ' << at.row;
  }
}

// Random windows agree on every post they share: the property borders rest on.
void expect_pure(const std::vector<std::string>& paths, const Lattice& lattice,
                 const PostWindow& whole, unsigned seed) {
  for (const Resampling resampling :
       {Resampling::kBilinear, Resampling::kCubic, Resampling::kNearest}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937 random(seed);
    Sampler first = sampler_of(paths, resampling);
    const std::vector<float> heights = sampled(first, lattice, whole);
    EXPECT_TRUE(
        std::any_of(heights.begin(), heights.end(), [](float h) { return !std::isnan(h); }));
    Sampler second = sampler_of(paths, resampling);
    for (int trial = 0; trial < 25; ++trial) {
      const auto pick = [&random](int low, int high) {
        return low + static_cast<int>(random() % static_cast<unsigned>(high - low + 1));
      };
      PostWindow part{.width_posts = pick(1, whole.width_posts),
                      .height_posts = pick(1, whole.height_posts)};
      const int di = pick(0, whole.width_posts - part.width_posts);
      const int dj = pick(0, whole.height_posts - part.height_posts);
      // The same posts under another name.
      part.i0 = whole.i0 + di + lattice.columns() * pick(-1, 1);
      part.j0 = whole.j0 + dj;
      const std::vector<float> again = sampled(second, lattice, part);
      for (int r = 0; r < part.height_posts; ++r) {
        for (int c = 0; c < part.width_posts; ++c) {
          const auto k = static_cast<std::size_t>((r + dj) * whole.width_posts + c + di);
          const auto m = static_cast<std::size_t>(r * part.width_posts + c);
          ASSERT_TRUE(same_bits(again[m], heights[k])) << "trial " << trial;
        }
      }
    }
  }
}

double rough(int c, int r) {
  const double wave = std::sin(c * 0.7) * 300 + std::cos(r * 1.3 + c * 0.11) * 200;
  return (c * 7919 + r * 104729) % 23 == 0 ? kNaN : wave;
}

TEST(Sampling, APostDoesNotDependOnItsWindowInUtm) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 300, .height = 300};
  fixture.value = rough;
  fixture.crs = "EPSG:32631";
  fixture.geotransform = {{600000, 90, 0, 5000000, 0, -90}};
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  const Lattice lattice(kGeodetic, 10);
  expect_pure({path}, lattice, around(lattice, 4.44, 45.05, 130, 110), 1);
  // A coarse lattice splits its anchors' cells, and its reads.
  expect_pure({path}, Lattice(kGeodetic, 4), around(Lattice(kGeodetic, 4), 4.44, 45.05, 40, 40), 2);
}

TEST(Sampling, APostDoesNotDependOnItsWindowAcrossTheAntimeridian) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 360, .height = 180};
  fixture.value = rough;
  fixture.geotransform = {{0, 1, 0, 90, 0, -1}};
  write_raster(file_in(folder, "world.tif"), fixture);
  const Lattice lattice(kGeodetic, 1);
  const std::int64_t columns = lattice.columns();
  expect_pure({file_in(folder, "world.tif")}, lattice,
              {.i0 = columns - 100, .j0 = 100, .width_posts = 300, .height_posts = 60}, 3);
  // The raster's own seam, in the middle of the lattice.
  expect_pure({file_in(folder, "world.tif")}, lattice,
              {.i0 = columns / 2 - 40, .j0 = 0, .width_posts = 90, .height_posts = 90}, 4);
}

TEST(Sampling, APostDoesNotDependOnItsWindowNearThePole) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 200, .height = 200};
  fixture.value = rough;
  fixture.crs = "EPSG:3031";
  fixture.geotransform = {{-1000000, 10000, 0, 1000000, 0, -10000}};
  write_raster(file_in(folder, "pole.tif"), fixture);
  const Lattice lattice(kGeodetic, 2);
  expect_pure({file_in(folder, "pole.tif")}, lattice,
              {.i0 = -50, .j0 = 0, .width_posts = 200, .height_posts = 50}, 5);
}

TEST(Sampling, APostDoesNotDependOnItsWindowInTheMercatorScheme) {
  const TemporaryFolder folder;
  RasterFixture fixture = plane_in_degrees();
  fixture.value = rough;
  write_raster(file_in(folder, "a.tif"), fixture);
  const Lattice lattice(TilingScheme(Projection::kMercator), 4);
  expect_pure({file_in(folder, "a.tif")}, lattice,
              {.i0 = 2150, .j0 = 2600, .width_posts = 120, .height_posts = 150}, 6);
}

TEST(Sampling, TheFirstValidSourceWins) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 8, .height = 8};
  fixture.geotransform = {{0, 1, 0, 8, 0, -1}};
  fixture.value = [](int c, int) { return c < 4 ? 1 : kNaN; };
  write_raster(file_in(folder, "first.tif"), fixture);
  fixture.value = [](int, int r) { return r < 6 ? 2 : kNaN; };
  write_raster(file_in(folder, "second.tif"), fixture);
  Sampler sampler = sampler_of({file_in(folder, "first.tif"), file_in(folder, "second.tif")});
  const Lattice lattice(kGeodetic, 2);
  const auto at = [&](double lon, double lat) {
    return sampled(sampler, lattice, around(lattice, lon, lat, 1, 1))[0];
  };
  EXPECT_EQ(at(2, 1), 1);
  EXPECT_EQ(at(2, 6), 1);
  EXPECT_EQ(at(6, 6), 2);
  EXPECT_TRUE(std::isnan(at(6, 1)));
  EXPECT_TRUE(std::isnan(at(20, 1)));
}

TEST(Sampling, VoidPixelsStayVoidAndDoNotSpread) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 9, .height = 9};
  fixture.geotransform = {{0, 1, 0, 9, 0, -1}};
  fixture.value = [](int c, int r) { return c == 4 && r == 4 ? kNaN : 7; };
  write_raster(file_in(folder, "a.tif"), fixture);
  for (const Resampling resampling :
       {Resampling::kBilinear, Resampling::kCubic, Resampling::kNearest}) {
    Sampler sampler = sampler_of({file_in(folder, "a.tif")}, resampling);
    const Lattice lattice(kGeodetic, 4);
    const PostWindow window = around(lattice, 4.5, 4.5, 150, 150);
    const std::vector<float> heights = sampled(sampler, lattice, window);
    for (std::size_t k = 0; k < heights.size(); ++k) {
      const double lon = lattice.longitude_deg(window.i0 + static_cast<int>(k) % 150);
      const double lat = lattice.latitude_deg(window.j0 + static_cast<int>(k) / 150);
      const bool is_inside = lon >= 0 && lon <= 9 && lat >= 0 && lat <= 9;
      const bool is_void = lon >= 4 && lon < 5 && lat > 4 && lat <= 5;
      ASSERT_EQ(!std::isnan(heights[k]), is_inside && !is_void) << lon << ' ' << lat;
      if (is_void || !is_inside) continue;
      ASSERT_FLOAT_EQ(heights[k], 7);
    }
  }
}

TEST(Sampling, RastersOfVoidsAndOfOnePixelWork) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 1, .height = 1};
  fixture.geotransform = {{10, 2, 0, 50, 0, -2}};
  fixture.value = [](int, int) { return 5; };
  write_raster(file_in(folder, "one.tif"), fixture);
  fixture.value = [](int, int) { return kNaN; };
  write_raster(file_in(folder, "void.tif"), fixture);
  const Lattice lattice(kGeodetic, 3);
  const PostWindow window = around(lattice, 11, 49, 30, 30);
  for (const Resampling resampling :
       {Resampling::kBilinear, Resampling::kCubic, Resampling::kNearest}) {
    Sampler one = sampler_of({file_in(folder, "one.tif")}, resampling);
    int valid = 0;
    for (const float height : sampled(one, lattice, window)) {
      if (std::isnan(height)) continue;
      EXPECT_EQ(height, 5);
      ++valid;
    }
    EXPECT_GT(valid, 400);
    Sampler none = sampler_of({file_in(folder, "void.tif")}, resampling);
    for (const float height : sampled(none, lattice, window)) EXPECT_TRUE(std::isnan(height));
  }
}

TEST(Sampling, GlobalGridsInterpolateAcrossTheirSeam) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 360, .height = 180};
  fixture.geotransform = {{-180, 1, 0, 90, 0, -1}};
  fixture.value = [](int c, int) { return c < 180 ? c : 359 - c; };  // 0 on both sides of the seam
  write_raster(file_in(folder, "a.tif"), fixture);
  Sampler sampler = sampler_of({file_in(folder, "a.tif")});
  const Lattice lattice(kGeodetic, 1);
  const std::vector<float> heights =
      sampled(sampler, lattice, {.i0 = -2, .j0 = 300, .width_posts = 5, .height_posts = 1});
  // Pixel centres stand half a degree from the seam on both sides, at height 0; posts 0.3515625
  // degrees apart.
  EXPECT_FLOAT_EQ(heights[2], 0);
  EXPECT_FLOAT_EQ(heights[1], 0);
  EXPECT_FLOAT_EQ(heights[0], 0.703125F - 0.5F);
  EXPECT_FLOAT_EQ(heights[4], heights[0]);
}

// The pixels on the two sides of the seam differ: one that is repeated beyond it would show.
TEST(Sampling, GlobalGridsTakeTheFirstPixelAfterTheLast) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 360, .height = 180};
  fixture.value = [](int c, int) { return c; };
  for (const double west_deg : {-180.0, -180.5, 0.0, -0.5}) {
    SCOPED_TRACE(west_deg);
    fixture.geotransform = {{west_deg, 1, 0, 90, 0, -1}};
    const std::string path = file_in(folder, "a.tif");
    write_raster(path, fixture);
    Sampler sampler = sampler_of({path});
    const Lattice lattice(kGeodetic, 1);
    const PostWindow window = around(lattice, west_deg, 15, 8, 2);
    const std::vector<float> heights = sampled(sampler, lattice, window);
    for (std::int32_t k = 0; k < window.width_posts; ++k) {
      // From the seam, eastwards; the last pixel's centre stands half a degree before it.
      const double east_deg =
          std::remainder(lattice.longitude_deg(window.i0 + k) - west_deg, 360.0);
      double expected = east_deg > 0 ? east_deg - 0.5 : 359.5 + east_deg;
      if (std::abs(east_deg) < 0.5) expected = (0.5 - east_deg) * 359;
      EXPECT_NEAR(heights[static_cast<std::size_t>(k)], expected, 1e-3) << east_deg;
    }
  }
}

TEST(Sampling, APoleHasOneHeight) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 36, .height = 18};
  fixture.geotransform = {{-180, 10, 0, 90, 0, -10}};
  write_raster(file_in(folder, "a.tif"), fixture);
  Sampler sampler = sampler_of({file_in(folder, "a.tif")});
  const Lattice lattice(kGeodetic, 0);
  for (const std::int64_t j : {std::int64_t{0}, lattice.rows() - 1}) {
    const std::vector<float> row =
        sampled(sampler, lattice, {.i0 = 0, .j0 = j, .width_posts = 512, .height_posts = 1});
    EXPECT_FALSE(std::isnan(row[0]));
    for (const float height : row) EXPECT_EQ(height, row[0]);
  }
}

TEST(Sampling, RowsOutsideTheLatticeAreVoid) {
  const TemporaryFolder folder;
  write_raster(file_in(folder, "a.tif"), plane_in_degrees());
  Sampler sampler = sampler_of({file_in(folder, "a.tif")});
  const Lattice lattice(kGeodetic, 0);
  for (const std::int64_t j : {std::int64_t{-3}, lattice.rows() + 1}) {
    for (const float height :
         sampled(sampler, lattice, {.i0 = 270, .j0 = j, .width_posts = 20, .height_posts = 2})) {
      EXPECT_TRUE(std::isnan(height));
    }
  }
}

TEST(Sampling, WindowsThatMayNotBeCoveredAreVoid) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 60, .height = 40};
  fixture.geotransform = {{160, 1, 0, 40, 0, -1}};
  write_raster(file_in(folder, "a.tif"), fixture);
  Sampler sampler = sampler_of({file_in(folder, "a.tif")});
  const Lattice lattice(kGeodetic, 3);
  int covered = 0;
  for (int x = 0; x < 16; ++x) {
    for (int y = 0; y < 8; ++y) {
      const PostWindow window = Lattice::tile_window({.zoom = 3, .x = x, .y = y}, 2);
      const std::vector<float> heights = sampled(sampler, lattice, window);
      const bool is_void =
          std::all_of(heights.begin(), heights.end(), [](float h) { return std::isnan(h); });
      EXPECT_TRUE(is_void || sampler.may_cover(lattice, window));
      covered += is_void ? 0 : 1;
    }
  }
  // Three columns around the antimeridian; two rows, and one that touches the raster's side.
  EXPECT_EQ(covered, 9);
}

TEST(SamplingZoom, PostsAreNoFartherApartThanPixels) {
  const auto zoom_of = [](double pixel_deg) {
    RasterInfo info;
    info.pixel_deg = pixel_deg;
    return sampling_zoom_for(kGeodetic, std::span(&info, 1));
  };
  EXPECT_EQ(zoom_of(10), 0);
  EXPECT_EQ(zoom_of(0.703125), 0);
  EXPECT_EQ(zoom_of(0.703125 * (1 - 1e-9)), 0);
  EXPECT_EQ(zoom_of(0.7), 1);
  EXPECT_EQ(zoom_of(1.0 / 1200), 10);
  EXPECT_EQ(zoom_of(1e-12), kMaxZoom);
}

}  // namespace
}  // namespace qmpipe::testing::sampling_test
