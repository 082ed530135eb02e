// Cylindrical projections go round the globe: a raster is whole wherever it lies along x.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <string>

#include "formats/crs/transform.h"
#include "stages/posts/sampling.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::periodic_projection_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::Not;

constexpr double kDegree_m = 6378137 * 3.14159265358979323846 / 180;

struct Cylinder {
  std::string crs;
  double middle_deg;  // its central meridian
  double degree;      // of longitude, in its unit
  double middle_x = 0;
};

const std::vector<Cylinder>& cylinders() {
  static const std::vector<Cylinder> all = {
      {"EPSG:3857", 0, kDegree_m},
      {"EPSG:3395", 0, kDegree_m},
      {"EPSG:4087", 0, kDegree_m},
      {"+proj=merc +lon_0=150 +datum=WGS84 +type=crs", 150, kDegree_m},
      {"+proj=eqc +lon_0=180 +x_0=1000000 +datum=WGS84 +type=crs", 180, kDegree_m, 1000000},
      {"+proj=merc +lon_0=-100 +units=us-ft +datum=WGS84 +type=crs", -100, kDegree_m * 3937 / 1200},
      {"+proj=mill +lon_0=11 +R=6378137 +type=crs", 11, kDegree_m},
      {"+proj=cea +datum=WGS84 +type=crs", 0, kDegree_m},
      {"+proj=gall +R=6378137 +type=crs", 0, kDegree_m / std::sqrt(2.0)}};
  return all;
}

double height_at(double longitude_deg, double latitude_deg) {
  const double radian = 3.14159265358979323846 / 180;
  return 1000 + 500 * std::cos((longitude_deg - 20) * radian) +
         200 * std::sin(3 * longitude_deg * radian) * std::cos(latitude_deg * radian) +
         5 * latitude_deg;
}

struct Extent {
  double west_deg;
  double width_deg;
  double pixel_deg;
};

constexpr double kSouth_deg = -35;
constexpr double kNorth_deg = 50;

RasterFixture on_cylinder(const Cylinder& cylinder, const Extent& extent) {
  const std::array<MapPoint, 1> anywhere = {{{cylinder.middle_x, 0}}};
  const std::shared_ptr<CrsTransform> way =
      CrsTransform::make({.wkt = cylinder.crs, .axes = {1, 2}}, anywhere);
  const double top =
      way->forward({.longitude_deg = cylinder.middle_deg, .latitude_deg = kNorth_deg})->y;
  const double bottom =
      way->forward({.longitude_deg = cylinder.middle_deg, .latitude_deg = kSouth_deg})->y;
  RasterFixture fixture{.width = static_cast<int>(std::lround(extent.width_deg / extent.pixel_deg)),
                        .height = 60};
  const double pixel_height = (top - bottom) / fixture.height;
  fixture.crs = cylinder.crs;
  fixture.geotransform = {
      {cylinder.middle_x + (extent.west_deg - cylinder.middle_deg) * cylinder.degree,
       extent.pixel_deg * cylinder.degree, 0, top, 0, -pixel_height}};
  fixture.value = [way, cylinder, extent, top, pixel_height](int c, int r) {
    const double latitude_deg =
        way->inverse({.x = cylinder.middle_x, .y = top - (r + 0.5) * pixel_height})->latitude_deg;
    return height_at(extent.west_deg + (c + 0.5) * extent.pixel_deg, latitude_deg);
  };
  return fixture;
}

// Every post of a coarse zoom: there where the raster is, with the height of its place.
void expect_whole(const std::string& path, const Extent& extent, const TilingScheme& scheme) {
  const Lattice lattice(scheme, 0);
  Sampler sampler(pool_of({path}), Resampling::kBilinear);
  const PostWindow all{.width_posts = static_cast<std::int32_t>(lattice.columns()),
                       .height_posts = static_cast<std::int32_t>(lattice.rows())};
  std::vector<float> heights(all.size());
  sampler.sample(lattice, all, heights);
  const double half = extent.pixel_deg / 2;
  int inside = 0;
  for (std::size_t k = 0; k < heights.size(); ++k) {
    const double lon = lattice.longitude_deg(static_cast<std::int64_t>(k) % all.width_posts);
    const double lat = lattice.latitude_deg(static_cast<std::int64_t>(k) / all.width_posts);
    if (lattice.is_pole_row(static_cast<std::int64_t>(k) / all.width_posts)) continue;
    const double turns = (lon - extent.west_deg) / 360;
    const double ahead = (turns - std::floor(turns)) * 360;
    // To the nearest edge in degrees; less than nothing outside.
    double in_deg = std::min(ahead, extent.width_deg - ahead);
    if (extent.width_deg >= 360) in_deg = 180;
    in_deg = std::min(in_deg, std::min(lat - kSouth_deg, kNorth_deg - lat));
    if (std::abs(in_deg) < 0.03 * extent.pixel_deg) continue;
    ASSERT_EQ(!std::isnan(heights[k]), in_deg > 0) << lon << ' ' << lat;
    if (in_deg < 0) continue;
    ++inside;
    // Within half a pixel of an edge the outermost pixels are repeated.
    const bool is_rim = in_deg < 1.5 || (extent.width_deg >= 360 && ahead < half);
    ASSERT_NEAR(heights[k], height_at(lon, lat), is_rim ? 30 : 2) << lon << ' ' << lat;
  }
  EXPECT_GT(inside, 100);
}

TEST(PeriodicProjection, ARasterIsWholeWhereverItLiesAlongX) {
  const unsigned seed = 20261129;
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 dice(seed);
  const std::vector<Extent> extents = {
      {-60, 120, 2},  {100, 100, 2},  {150, 60, 1.5}, {-215, 60, 2}, {0, 360, 2}, {-180, 360, 2},
      {-180, 401, 1}, {20, 500, 2.5}, {360, 20, 0.5}, {-720, 40, 2}, {1, 359, 1}};
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "a.tif");
  for (std::size_t turn = 0; turn < 24; ++turn) {
    const Cylinder& cylinder = cylinders()[turn < 9 ? turn : dice() % cylinders().size()];
    Extent extent = extents[turn < 11 ? turn : dice() % extents.size()];
    if (turn > 16) extent.west_deg += static_cast<double>(dice() % 3600) / 10 - 180;
    SCOPED_TRACE(cylinder.crs + " west " + std::to_string(extent.west_deg) + " width " +
                 std::to_string(extent.width_deg));
    write_raster(path, on_cylinder(cylinder, extent));
    expect_whole(path, extent, TilingScheme(Projection::kGeodetic));
    expect_whole(path, extent, TilingScheme(Projection::kMercator));
    const RasterInfo info = RasterSource::open(path)->info();
    EXPECT_EQ(info.wraps_columns, extent.width_deg == 360);
    EXPECT_THAT(info.assumptions, Not(Contains(HasSubstr("nowhere"))));
  }
}

// A turn beside its middle a raster may have what is void there.
TEST(PeriodicProjection, WhatIsVoidInOneTurnIsTakenFromTheNext) {
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "a.tif");
  const Lattice lattice(TilingScheme(Projection::kGeodetic), 0);
  for (const char* crs : {"EPSG:4087", "EPSG:4326"}) {
    const double degree = crs == std::string("EPSG:4326") ? 1 : kDegree_m;
    RasterFixture fixture{.width = 900, .height = 40};
    fixture.crs = crs;
    fixture.geotransform = {{-450 * degree, degree, 0, 20 * degree, 0, -degree}};
    fixture.value = [](int c, int) {
      if (c < 100) return 1.0;
      return c >= 800 && c < 850 ? 2.0 : std::nan("");
    };
    write_raster(path, fixture);
    Sampler sampler(pool_of({path}), Resampling::kBilinear);
    const auto height = [&](double longitude_deg) {
      std::vector<float> one(1);
      sampler.sample(lattice,
                     {.i0 = static_cast<std::int64_t>(lattice.column_at(longitude_deg)),
                      .j0 = 128,
                      .width_posts = 1,
                      .height_posts = 1},
                     one);
      return one[0];
    };
    // Columns 0 to 99 begin at -450, that is at -90; 800 to 849 at 350, that is at -10.
    EXPECT_EQ(height(-89), 1) << crs;
    EXPECT_EQ(height(-50), 1);
    // Both have it, and neither in its middle.
    EXPECT_EQ(height(9), 2);
    EXPECT_EQ(height(30), 2);
    EXPECT_TRUE(std::isnan(height(60)));
    EXPECT_TRUE(std::isnan(height(-100)));
  }
}

TEST(PeriodicProjection, OnlyCylindersTurn) {
  for (const Cylinder& cylinder : cylinders()) {
    const double turn = CrsTransform::turn_along_x({.wkt = cylinder.crs, .axes = {1, 2}});
    EXPECT_NEAR(turn / (360 * cylinder.degree), 1, 1e-13) << cylinder.crs;
  }
  // Northing before easting, and metres of another datum.
  EXPECT_NEAR(CrsTransform::turn_along_x({.wkt = "EPSG:3388", .axes = {2, 1}}), 40075016, 3e7);
  EXPECT_GT(CrsTransform::turn_along_x({.wkt = "EPSG:3388", .axes = {2, 1}}), 2e7);
  EXPECT_EQ(CrsTransform::turn_along_x({.wkt = "EPSG:3388", .axes = {1, 2}}), 0);
  for (const char* crs :
       {"EPSG:32631", "EPSG:3035", "EPSG:3031", "EPSG:2154", "EPSG:27700", "EPSG:21781",
        "+proj=sinu +datum=WGS84 +type=crs", "+proj=moll +datum=WGS84 +type=crs",
        "+proj=robin +datum=WGS84 +type=crs", "+proj=healpix +datum=WGS84 +type=crs",
        "+proj=tcea +datum=WGS84 +type=crs", "+proj=cass +datum=WGS84 +type=crs",
        "+proj=ob_tran +o_proj=merc +o_lat_p=40 +datum=WGS84 +type=crs", "nonsense"}) {
    EXPECT_EQ(CrsTransform::turn_along_x({.wkt = crs, .axes = {1, 2}}), 0) << crs;
  }
}

TEST(PeriodicProjection, HeightsThatLieNowhereAreTold) {
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "a.tif");
  RasterFixture fixture{.width = 40, .height = 20};
  fixture.crs = "+proj=sinu +datum=WGS84 +type=crs";
  // On both sides of the map's eastern edge, around 60 degrees north.
  fixture.geotransform = {{9400000, 20000, 0, 6800000, 0, -20000}};
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions,
              Contains(HasSubstr("lie nowhere on the globe")));
  // All void beyond the edge.
  fixture.value = [](int c, int) { return c < 10 ? 5 : std::nan(""); };
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, Not(Contains(HasSubstr("nowhere"))));
  fixture = {.width = 40, .height = 40};
  fixture.crs = "EPSG:3031";
  fixture.geotransform = {{-2000000, 100000, 0, 2000000, 0, -100000}};
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, Not(Contains(HasSubstr("nowhere"))));
  fixture.crs = "EPSG:4326";
  fixture.geotransform = {{-5, 9, 0, 94.5, 0, -4.725}};
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, Contains(HasSubstr("about")));
  fixture.geotransform = {{-5, 9, 0, 90 + 1e-9, 0, -4.5}};
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, Not(Contains(HasSubstr("nowhere"))));
}

}  // namespace
}  // namespace qmpipe::testing::periodic_projection_test
