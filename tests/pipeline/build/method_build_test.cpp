// Whole builds with each method: sound sets, the same bytes on any number of threads.
#include <gtest/gtest.h>

#include "tests/support/build_fixture.h"

namespace qmpipe::method_build_test {
namespace {

using testing::hilly_raster;

struct MethodCase {
  Method method;
  Stop stop;
};

std::string name_of_case(const ::testing::TestParamInfo<MethodCase>& info) {
  std::string name = name_of(info.param.method) + "_by_" + name_of(info.param.stop);
  std::replace(name.begin(), name.end(), '-', '_');
  return name;
}

class MethodBuild : public testing::BuildTest, public ::testing::WithParamInterface<MethodCase> {
 protected:
  BuildOptions options_for_case(const std::string& dem, const std::string& out) {
    BuildOptions options = options_for({dem}, out);
    options.mesh.method = GetParam().method;
    options.mesh.stop = GetParam().stop;
    return options;
  }
};

INSTANTIATE_TEST_SUITE_P(All, MethodBuild,
                         ::testing::Values(MethodCase{Method::kGreedy, Stop::kTolerance},
                                           MethodCase{Method::kEdgeCollapse, Stop::kTolerance},
                                           MethodCase{Method::kEdgeCollapse, Stop::kEdges},
                                           MethodCase{Method::kPsRandom, Stop::kTolerance},
                                           MethodCase{Method::kPsGrid, Stop::kTolerance},
                                           MethodCase{Method::kPsHierarchy, Stop::kTolerance},
                                           MethodCase{Method::kPsWlop, Stop::kTolerance}),
                         name_of_case);

// With voids, across the antimeridian and down to the roots, in both schemes; the recipe reads back.
TEST_P(MethodBuild, SetsAreSoundInBothSchemes) {
  const std::string dem = write(hilly_raster(5, 178.6, 2.2, 0.02));
  for (const Projection projection : {Projection::kGeodetic, Projection::kMercator}) {
    SCOPED_TRACE(projection == Projection::kGeodetic ? "geodetic" : "mercator");
    BuildOptions options =
        options_for_case(dem, projection == Projection::kGeodetic ? "geodetic" : "mercator");
    options.mesh.projection = projection;
    const BuildResult result = run(options);
    expect_sound(options);
    const Result<Recipe> read = parse_recipe(write_recipe(result.recipe));
    ASSERT_TRUE(read.ok()) << read.error().message;
    EXPECT_EQ(*read, result.recipe);
    for (const BuiltZoom& zoom : result.report.zooms) {
      EXPECT_EQ(zoom.tolerance_m.has_value(), has_error_bound(GetParam().method, GetParam().stop));
      EXPECT_LE(zoom.error.largest_m, zoom.tolerance_m.value_or(1e9));
      EXPECT_EQ(zoom.parameters.size(),
                parameters_of(GetParam().method, GetParam().stop).size() +
                    (has_error_bound(GetParam().method, GetParam().stop) ? 0 : 1));
    }
  }
}

TEST_P(MethodBuild, BytesDoNotDependOnThreadsOrMemory) {
  const std::string dem = write(hilly_raster(6, 11.3, 47.7, 0.02));
  BuildOptions options = options_for_case(dem, "reference");
  options.run.threads = 1;
  run(options);
  const auto reference = contents(options);
  ASSERT_GT(reference.size(), 10U);
  for (const std::int32_t threads : {2, 8}) {
    BuildOptions other = options_for_case(dem, "other");
    other.output.overwrite = Overwrite::kYes;
    other.run.threads = threads;
    other.run.memory_bytes = threads == 8 ? 260LL << 20U : 0;
    run(other);
    EXPECT_EQ(contents(other), reference) << threads << " threads";
  }
}

}  // namespace
}  // namespace qmpipe::method_build_test
