// The real DEMs of the data folder open and hold what their description says.
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <limits>

#include "formats/sources/raster_source.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::real_dem_test {
namespace {

constexpr double kInf = std::numeric_limits<double>::infinity();

struct RealDem {
  const char* name;
  double lowest_m;
  double highest_m;
  double void_percent;
  double pixel_deg;
};

class RealDems : public ::testing::TestWithParam<RealDem> {};

TEST_P(RealDems, OpenAndAgreeWithTheirDescription) {
  const RealDem& dem = GetParam();
  const auto path = real_data(dem.name);
  if (!path) GTEST_SKIP() << "no real data (set QMPIPE_DATA)";
  const auto source = RasterSource::open(*path);
  double lowest = kInf;
  double highest = -kInf;
  double voids = 0;
  const std::vector<double> heights = read_all(*source);
  for (const double height : heights) {
    if (std::isnan(height)) {
      ++voids;
    } else {
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
  }
  EXPECT_NEAR(lowest, dem.lowest_m, 1);
  EXPECT_NEAR(highest, dem.highest_m, 1);
  EXPECT_NEAR(100 * voids / static_cast<double>(heights.size()), dem.void_percent, 0.06);
  EXPECT_NEAR(source->info().pixel_deg / dem.pixel_deg, 1, 0.01);
}

INSTANTIATE_TEST_SUITE_P(
    All, RealDems,
    ::testing::Values(RealDem{"N43E007.hgt.zip", -11, 2064, 0.11, 1.0 / 1200},
                      RealDem{"N41E001.hgt.zip", -20, 1204, 0.01, 1.0 / 1200},
                      RealDem{"N42E001.hgt.zip", 349, 3100, 0.53, 1.0 / 1200},
                      RealDem{"N49W124.tif", -26, 2630, 1.78, 1.0 / 1200},
                      RealDem{"N44E005_UTM.tif", 33, 2745, 6.37, 0.000809},
                      RealDem{"N44E005_big_hole.tif", 32, 1000, 34.0, 1.0 / 1200},
                      RealDem{"bigtujunga.tif", 315, 2295, 0, 0.0002705},
                      RealDem{"portland-ned-nodata.tif", 0, 328.1, 33.33, 1.0 / 10800},
                      RealDem{"cairns.zip", -2153, 1599, 0.97, 0.002447},
                      RealDem{"FR+IT.nc", -5035, 4086, 0, 1.0 / 30},
                      RealDem{"HI_topo_02.nc", -7438, 2804, 0, 1.0 / 12},
                      RealDem{"Kilauea.utm.nc", 0, 1505, 3.04, 0.0002709},
                      RealDem{"etopo1-1deg.tif", -9200, 5855, 0, 1},
                      RealDem{"JD211_public_Release_1-4_UTM.bag", -53, -51, 54.13, 1.7926e-5}),
    [](const ::testing::TestParamInfo<RealDem>& dem) {
      std::string name = dem.param.name;
      std::erase_if(name, [](char c) { return std::isalnum(static_cast<unsigned char>(c)) == 0; });
      return name;
    });

}  // namespace
}  // namespace qmpipe::testing::real_dem_test
