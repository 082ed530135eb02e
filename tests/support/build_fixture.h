// Whole builds of small rasters, for the tests that need one.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "pipeline/build/build.h"
#include "tests/support/raster_fixture.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing {

// Hills of several sizes with a hole in the middle; `west_deg` may put it across the antimeridian.
RasterFixture hilly_raster(std::uint32_t seed, double west_deg, double north_deg, double pixel_deg);

class BuildTest : public ::testing::Test {
 protected:
  std::string write(const RasterFixture& fixture, const std::string& name = "dem.tif");
  BuildOptions options_for(const std::vector<std::string>& inputs, const std::string& out);
  static BuildResult run(const BuildOptions& options);
  // Every file of a set but the report, which holds times.
  static std::map<std::string, std::vector<std::uint8_t>> contents(const BuildOptions& options);
  static void expect_sound(const BuildOptions& options);

  TemporaryFolder folder_;
};

}  // namespace qmpipe::testing
