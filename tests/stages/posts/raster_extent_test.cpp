// How large the pixels of a raster are on the globe, which decides the zoom that it is sampled at.
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "stages/posts/sampling.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::raster_extent_test {
namespace {

constexpr double kMetresPerDegree = 6378137 * 3.14159265358979323846 / 180;

class PixelSize : public ::testing::Test {
 protected:
  double pixel_deg(const RasterFixture& fixture) const {
    return open_fixture(file_in(folder_, "a.tif"), fixture)->info().pixel_deg;
  }
  std::int32_t zoom_of(const RasterFixture& fixture) const {
    const RasterInfo info = open_fixture(file_in(folder_, "a.tif"), fixture)->info();
    return sampling_zoom_for(TilingScheme(Projection::kGeodetic), std::span(&info, 1));
  }

  const TemporaryFolder folder_;
};

// As far as the pole is from a raster's middle, in pixels.
RasterFixture polar(const std::string& crs, int width, double pixel_m, double columns,
                    double rows) {
  RasterFixture fixture{.width = width, .height = width};
  fixture.crs = crs;
  fixture.geotransform = {{-(width / 2.0 + columns) * pixel_m, pixel_m, 0,
                           (width / 2.0 + rows) * pixel_m, 0, -pixel_m}};
  return fixture;
}

TEST_F(PixelSize, IsTheSameWhereverInItsPixelThePoleLies) {
  const unsigned seed = 20261129;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 dice(seed);
  std::uniform_real_distribution<double> anywhere(-1, 1);
  for (const char* crs : {"EPSG:3031", "EPSG:3413", "EPSG:3409"}) {
    for (int turn = 0; turn < 40; ++turn) {
      double columns = anywhere(dice);
      double rows = anywhere(dice);
      // On a corner, on a side, in the middle of a pixel, almost there, and anywhere.
      if (turn < 20) {
        columns = std::round(2 * columns) / 2 + (turn % 2) * 1e-9;
        rows = std::round(2 * rows) / 2 - (turn % 3) * 1e-7;
      }
      const int width = 1 + static_cast<int>(dice() % 120);
      SCOPED_TRACE(std::string(crs) + " width " + std::to_string(width) + " pole " +
                   std::to_string(columns) + " " + std::to_string(rows));
      // Neither projection's scale is farther from 1 than that near its pole.
      EXPECT_NEAR(pixel_deg(polar(crs, width, 5000, columns, rows)) * kMetresPerDegree / 5000, 1,
                  0.035);
      // A pixel or two of half a metre are at the last digits of PROJ's way out and back.
      EXPECT_NEAR(pixel_deg(polar(crs, width, 0.5, columns, rows)) * kMetresPerDegree / 0.5, 1,
                  0.06);
    }
  }
}

TEST_F(PixelSize, PolarRastersOfOddAndEvenWidthHaveOneZoom) {
  RasterFixture odd = polar("EPSG:3031", 101, 5000, 0, 0);
  // The pole touches the middle of the middle pixel, but for some metres.
  odd.geotransform = {{-253134, 5000, 0, 251866, 0, -5000}};
  EXPECT_EQ(zoom_of(odd), 4);
  EXPECT_EQ(zoom_of(polar("EPSG:3031", 101, 5000, 0, 0)), 4);
  EXPECT_EQ(zoom_of(polar("EPSG:3031", 102, 5000, 0, 0)), 4);
  EXPECT_EQ(zoom_of(polar("EPSG:3031", 102, 5000, 0.5, 0)), 4);
}

// The posts of both schemes converge at the poles as these pixels do.
TEST_F(PixelSize, CylindricalGridsHaveTheirDegreesUpToThePoles) {
  for (const double degrees : {0.5, 4.0}) {
    RasterFixture fixture{.width = static_cast<int>(360 / degrees),
                          .height = static_cast<int>(180 / degrees)};
    fixture.crs = "EPSG:4087";
    const double pixel_m = degrees * kMetresPerDegree;
    fixture.geotransform = {
        {-180 * kMetresPerDegree, pixel_m, 0, 90 * kMetresPerDegree, 0, -pixel_m}};
    EXPECT_NEAR(pixel_deg(fixture) / degrees, 1, 1e-6);
    fixture.crs = "EPSG:4267";
    fixture.geotransform = {{-180, degrees, 0, 90, 0, -degrees}};
    EXPECT_NEAR(pixel_deg(fixture) / degrees, 1, 1e-6);
  }
}

TEST_F(PixelSize, IsThatOfThePosts) {
  RasterFixture fixture{.width = 16, .height = 16};
  fixture.crs = "EPSG:3857";
  // Pixels that are the posts of the tiling: to a millionth.
  for (const int zoom : {3, 10, 20}) {
    const double pixel_m = std::ldexp(0.703125, -zoom) * kMetresPerDegree;
    fixture.geotransform = {{0, pixel_m, 0, 8 * pixel_m, 0, -pixel_m}};
    EXPECT_NEAR(pixel_deg(fixture) / std::ldexp(0.703125, -zoom), 1, zoom > 3 ? 1e-6 : 0.01);
  }
  // On the ground along the meridian, where longer than a degree of the equator.
  fixture.crs = "EPSG:32631";
  fixture.geotransform = {{500000, 30, 0, 6651411, 0, -30}};
  EXPECT_NEAR(pixel_deg(fixture) * 111412 / 30, 1, 0.002);
  // Turned by 45 degrees: the pixel is no smaller for it.
  const double part = 30 / std::sqrt(2.0);
  fixture.geotransform = {{500000, part, part, 6651411, part, -part}};
  EXPECT_NEAR(pixel_deg(fixture) * 111412 / 30, 1, 0.002);
  fixture.crs = "EPSG:4326";
  fixture.geotransform = {{10, 0.6, 0.8, 50, 0.8, -0.6}};
  EXPECT_NEAR(pixel_deg(fixture), 1, 1e-12);
}

}  // namespace
}  // namespace qmpipe::testing::raster_extent_test
