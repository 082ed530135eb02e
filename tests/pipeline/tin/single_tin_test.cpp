// One DEM to one TIN: what its options promise, on rasters small enough to be judged by brute force.
#include "pipeline/tin/single_tin.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "formats/bytes/errors.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::single_tin_test {
namespace {

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test
using ::testing::HasSubstr;

constexpr const char* kUtm = "EPSG:32632";

// Hills with some noise, metres.
double rolling(std::uint64_t seed, int c, int r) {
  std::mt19937_64 random(seed * 1000003 + static_cast<std::uint64_t>(c * 4099 + r));
  const double noise = static_cast<double>(random() % 1000) / 1000;
  return 300 * std::sin(0.13 * c) * std::cos(0.09 * r + 0.1 * static_cast<double>(seed)) + noise +
         500;
}
// And a cliff.
double hilly(std::uint64_t seed, int c, int r) { return rolling(seed, c, r) + (c > 30 ? 120 : 0); }

RasterFixture hills(std::uint64_t seed) {
  return {.width = 61,
          .height = 47,
          .geotransform = {{400000, 25, 0, 5000000, 0, -20}},
          .crs = kUtm,
          .value = [seed](int c, int r) { return hilly(seed, c, r); }};
}

std::string written(const TemporaryFolder& folder, const RasterFixture& fixture) {
  const std::string path = file_in(folder, "dem.tif");
  write_raster(path, fixture);
  return path;
}

template <class Act>
std::string refusal(const Act& act) {
  try {
    act();
  } catch (const std::runtime_error& error) {
    return error.what();
  }
  return "";
}

// The surface at a place of the local frame by trying every triangle; NaN where there is none.
double height_slowly(const ExportMesh& mesh, double x, double y) {
  for (std::size_t t = 0; t < mesh.indices.size(); t += 3) {
    const Vec3& a = mesh.positions_m[mesh.indices[t]];
    const Vec3& b = mesh.positions_m[mesh.indices[t + 1]];
    const Vec3& c = mesh.positions_m[mesh.indices[t + 2]];
    const double area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    const double wb = ((x - a[0]) * (c[1] - a[1]) - (y - a[1]) * (c[0] - a[0])) / area;
    const double wc = ((b[0] - a[0]) * (y - a[1]) - (b[1] - a[1]) * (x - a[0])) / area;
    if (std::min({wb, wc, 1 - wb - wc}) < -1e-9) continue;
    return (1 - wb - wc) * a[2] + wb * b[2] + wc * c[2];
  }
  return std::numeric_limits<double>::quiet_NaN();
}

// The largest distance of a pixel's height from the mesh, from the raster's own values: row 0 is the
// northernmost, column 0 the westernmost. Pixels without surface do not count.
double largest_error_slowly(const ExportMesh& mesh, const RasterFixture& fixture) {
  const double dx = std::abs((*fixture.geotransform)[1]);
  const double dy = std::abs((*fixture.geotransform)[5]);
  double largest = 0;
  for (int r = 0; r < fixture.height; ++r) {
    for (int c = 0; c < fixture.width; ++c) {
      const double x = (c - 0.5 * (fixture.width - 1)) * dx;
      const double y = (0.5 * (fixture.height - 1) - r) * dy;
      const auto height = static_cast<double>(static_cast<float>(fixture.value(c, r)));
      if (fixture.void_value && fixture.value(c, r) == *fixture.void_value) continue;
      const double surface = height_slowly(mesh, x, y);
      if (!std::isnan(surface)) largest = std::max(largest, std::abs(surface - height));
    }
  }
  return largest;
}

// Without the cliff, which WLOP smooths away, and with parameters that leave each method's size to the
// target.
RasterFixture rolling_hills(std::uint64_t seed) {
  RasterFixture fixture = hills(seed);
  fixture.value = [seed](int c, int r) { return rolling(seed, c, r); };
  return fixture;
}
SingleTinOptions options_of(Method method, const std::string& input) {
  SingleTinOptions options{.input = input, .method = method};
  options.parameters.set("p_e", ZoomSeries({1}));
  options.parameters.set("p_b", ZoomSeries({50}));
  options.parameters.set("h_v", ZoomSeries({0.33}));
  options.parameters.set("w_r", ZoomSeries({60}));
  return options;
}

class EveryMethod : public ::testing::TestWithParam<Method> {};
INSTANTIATE_TEST_SUITE_P(SingleTin, EveryMethod, ::testing::ValuesIn(kMethods),
                         [](const auto& method) {
                           std::string name = name_of(method.param);
                           std::replace(name.begin(), name.end(), '-', '_');
                           return name;
                         });

TEST_P(EveryMethod, HoldsAToleranceAtEveryPost) {
  for (const std::uint64_t seed : {1U, 2U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    const TemporaryFolder folder;
    const RasterFixture fixture = rolling_hills(seed);
    SingleTinOptions options = options_of(GetParam(), written(folder, fixture));
    options.target.tolerance_m = 30;
    const SingleTin single = make_single_tin(options);
    const double largest_m = largest_error_slowly(mesh_of(single, TinFrame::kLocal), fixture);
    EXPECT_LE(largest_m, 30);
    EXPECT_NEAR(single.result.error.largest_m, largest_m, 1e-6);
    EXPECT_EQ(single.result.error.posts, 61 * 47);
    // Coarser than the full grid, or the tolerance was no target.
    EXPECT_LT(single.result.tin.triangle_count(), 2U * 60 * 46 * 9 / 10);
  }
}

TEST_P(EveryMethod, HasAtMostTheTrianglesItWasGiven) {
  const TemporaryFolder folder;
  SingleTinOptions options = options_of(GetParam(), written(folder, rolling_hills(3)));
  options.parameters.set("p_e", ZoomSeries({100}));
  for (const std::int64_t most : {300, 1000}) {
    options.target.most_triangles = most;
    const SingleTin single = make_single_tin(options);
    const auto triangles = static_cast<std::int64_t>(single.result.tin.triangle_count());
    EXPECT_LE(triangles, most);
    EXPECT_GE(triangles, most / 2);
  }
}

TEST_P(EveryMethod, GivesTheSameBytesTwice) {
  const TemporaryFolder folder;
  SingleTinOptions options = options_of(GetParam(), written(folder, rolling_hills(4)));
  options.target.tolerance_m = 40;
  for (const char* name : {"one.ply", "two.ply"}) {
    write_mesh_file(file_in(folder, name), mesh_of(make_single_tin(options), TinFrame::kLocal));
  }
  EXPECT_EQ(folder.get("one.ply"), folder.get("two.ply"));
}

TEST(SingleTin, GreedyHoldsFineTolerancesToo) {
  for (const double tolerance_m : {0.01, 1.0, 7.0}) {
    const TemporaryFolder folder;
    const RasterFixture fixture = hills(5);
    SingleTinOptions options{.input = written(folder, fixture)};
    options.target.tolerance_m = tolerance_m;
    const SingleTin single = make_single_tin(options);
    EXPECT_LE(largest_error_slowly(mesh_of(single, TinFrame::kLocal), fixture), tolerance_m);
    EXPECT_LE(single.result.height_step_m, tolerance_m / 16);
  }
}

TEST(SingleTin, WithoutATargetTheParametersDecide) {
  const TemporaryFolder folder;
  SingleTinOptions options{.input = written(folder, hills(6))};
  const SingleTin by_default = make_single_tin(options);
  EXPECT_LE(by_default.result.error.largest_m, 5);
  options.parameters.set("g_e", ZoomSeries({80}, 0.5));
  const SingleTin coarse = make_single_tin(options);
  EXPECT_GT(coarse.result.error.largest_m, 5);
  EXPECT_LE(coarse.result.error.largest_m, 80);
  EXPECT_EQ(coarse.result.values, (ParameterValues{{"g_e", 80}, {"g_g", 0}}));
}

TEST(SingleTin, VoidsAreLeftOutAndDoNotCount) {
  const TemporaryFolder folder;
  RasterFixture fixture = hills(7);
  fixture.void_value = -9999;
  const auto is_hole = [](int c, int r) { return c >= 20 && c < 45 && r >= 10 && r < 30; };
  fixture.value = [&is_hole](int c, int r) { return is_hole(c, r) ? -9999 : hilly(7, c, r); };
  SingleTinOptions options{.input = written(folder, fixture)};
  options.target.tolerance_m = 3;
  const SingleTin single = make_single_tin(options);
  const TargetedTin& result = single.result;
  EXPECT_EQ(single.dem.void_count, 25 * 20);
  EXPECT_GT(result.void_triangles, 0);
  const ExportMesh mesh = mesh_of(single, TinFrame::kLocal);
  EXPECT_LE(largest_error_slowly(mesh, fixture), 3);
  // The middle of the hole is open, and nowhere is a height made of the void value.
  EXPECT_TRUE(std::isnan(height_slowly(mesh, (32 - 30) * 25.0, (23 - 20) * 20.0)));
  for (const Vec3& position : mesh.positions_m) EXPECT_GT(position[2], 0);
  // Every vertex has a triangle.
  std::vector<bool> used(mesh.positions_m.size(), false);
  for (const std::uint32_t index : mesh.indices) used.at(index) = true;
  EXPECT_EQ(std::count(used.begin(), used.end(), false), 0);
  // Posts counted: the valid ones, but for those left out with the hole, which are few.
  EXPECT_LE(result.error.posts, 61 * 47 - 25 * 20);
  EXPECT_GT(result.error.posts, 61 * 47 - 25 * 20 - 60);
  EXPECT_LT(result.covered_voids, 60);
}

TEST(SingleTin, FilledHeightsLieBetweenTheValidOnesAround) {
  const TemporaryFolder folder;
  RasterFixture fixture = hills(8);
  fixture.void_value = -9999;
  fixture.value = [](int c, int r) {
    return c > 10 && c < 50 && r > 5 && r < 40 ? -9999 : 100 + c;
  };
  const Dem dem =
      read_dem(*RasterSource::open(written(folder, fixture), {.placing = Placing::kPlane}));
  for (std::int32_t j = 0; j < dem.grid.height_posts; ++j) {
    for (std::int32_t i = 0; i + 1 < dem.grid.width_posts; ++i) {
      const auto k = static_cast<std::size_t>(dem.grid.index(i, j));
      EXPECT_GE(dem.heights_m[k], 100);
      EXPECT_LE(dem.heights_m[k], 160);
      // Smooth: across a slope of 1 m a post, no cliff anywhere.
      EXPECT_LT(std::abs(dem.heights_m[k + 1] - dem.heights_m[k]), 12);
    }
  }
}

TEST(SingleTin, ThePictureDoesNotDependOnTheOrderOfRowsAndColumns) {
  const TemporaryFolder folder;
  const RasterFixture plain = hills(9);
  const auto mesh_of_fixture = [&folder](const RasterFixture& fixture) {
    SingleTinOptions options{.input = written(folder, fixture)};
    options.target.tolerance_m = 10;
    const SingleTin single = make_single_tin(options);
    return std::pair(mesh_of(single, TinFrame::kLocal), mesh_of(single, TinFrame::kCrs));
  };
  RasterFixture south_up = plain;
  south_up.geotransform = {{400000, 25, 0, 5000000 - 47 * 20, 0, 20}};
  south_up.value = [](int c, int r) { return hilly(9, c, 46 - r); };
  RasterFixture mirrored = plain;
  mirrored.geotransform = {{400000 + 61 * 25, -25, 0, 5000000, 0, -20}};
  mirrored.value = [](int c, int r) { return hilly(9, 60 - c, r); };
  const auto wanted = mesh_of_fixture(plain);
  for (const RasterFixture& fixture : {south_up, mirrored}) {
    const auto got = mesh_of_fixture(fixture);
    EXPECT_EQ(got.first.positions_m, wanted.first.positions_m);
    EXPECT_EQ(got.second.positions_m, wanted.second.positions_m);
    EXPECT_EQ(got.first.indices, wanted.first.indices);
  }
}

TEST(SingleTin, CornersLieWhereTheFramesSay) {
  const TemporaryFolder folder;
  const RasterFixture fixture = hills(10);
  SingleTinOptions options{.input = written(folder, fixture)};
  options.target.tolerance_m = 5;
  const SingleTin single = make_single_tin(options);
  // Greedy insertion starts with the corners: south-west, south-east, north-east, north-west.
  const ExportMesh local = mesh_of(single, TinFrame::kLocal);
  const ExportMesh crs = mesh_of(single, TinFrame::kCrs);
  const double step = single.result.height_step_m;
  EXPECT_NEAR(local.positions_m[0][0], -30 * 25, 1e-9);
  EXPECT_NEAR(local.positions_m[0][1], -23 * 20, 1e-9);
  EXPECT_NEAR(local.positions_m[0][2], hilly(10, 0, 46), step / 2 + 1e-4);
  EXPECT_NEAR(local.positions_m[2][0], 30 * 25, 1e-9);
  EXPECT_NEAR(local.positions_m[2][1], 23 * 20, 1e-9);
  EXPECT_NEAR(local.positions_m[2][2], hilly(10, 60, 0), step / 2 + 1e-4);
  EXPECT_NEAR(crs.positions_m[0][0], 400000 + 12.5, 1e-6);
  EXPECT_NEAR(crs.positions_m[0][1], 5000000 - 46.5 * 20, 1e-6);
  EXPECT_NEAR(crs.positions_m[2][0], 400000 + 60.5 * 25, 1e-6);
  EXPECT_NEAR(crs.positions_m[2][1], 5000000 - 10, 1e-6);
  EXPECT_EQ(crs.positions_m[2][2], local.positions_m[2][2]);
  for (std::size_t t = 0; t < local.indices.size(); t += 3) {
    const Vec3& a = local.positions_m[local.indices[t]];
    const Vec3& b = local.positions_m[local.indices[t + 1]];
    const Vec3& c = local.positions_m[local.indices[t + 2]];
    ASSERT_GT((b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]), 0);
  }
}

PostSpacing spacing_of(const RasterFixture& fixture) {
  const TemporaryFolder folder;
  return post_spacing(
      RasterSource::open(written(folder, fixture), {.placing = Placing::kPlane})->info());
}

TEST(SingleTin, SpacingIsInMetresWhateverTheUnit) {
  // Lengths of a degree on WGS84 as tables have them, of the parallel and the meridian.
  RasterFixture degrees{.geotransform = {{10, 0.01, 0, 45 + 0.015, 0, -0.01}}};
  EXPECT_NEAR(spacing_of(degrees).x_m, 788.468, 0.01);
  EXPECT_NEAR(spacing_of(degrees).y_m, 1111.318, 0.01);
  degrees.geotransform = {{10, 0.01, 0, 0.015, 0, -0.01}};
  EXPECT_NEAR(spacing_of(degrees).x_m, 1113.195, 0.01);
  EXPECT_NEAR(spacing_of(degrees).y_m, 1105.743, 0.01);
  // New York Long Island, US survey feet.
  const RasterFixture feet{.geotransform = {{900000, 10, 0, 200000, 0, -10}}, .crs = "EPSG:2263"};
  EXPECT_NEAR(spacing_of(feet).x_m, 10 * 1200.0 / 3937, 1e-9);
  const RasterFixture bare{.geotransform = {{0, 2, 0, 30, 0, -3}}, .crs = ""};
  EXPECT_EQ(spacing_of(bare).x_m, 2);
  EXPECT_EQ(spacing_of(bare).y_m, 3);
  const RasterFixture nowhere{.geotransform = std::nullopt, .crs = ""};
  EXPECT_EQ(spacing_of(nowhere).x_m, 1);
  EXPECT_EQ(spacing_of(nowhere).y_m, 1);
}

TEST(SingleTin, WhatIsAssumedIsSaid) {
  const TemporaryFolder folder;
  const RasterFixture nowhere{.geotransform = std::nullopt, .crs = ""};
  const auto source = RasterSource::open(written(folder, nowhere), {.placing = Placing::kPlane});
  EXPECT_THAT(source->info().assumptions,
              ::testing::ElementsAre(HasSubstr("taken as metres"), HasSubstr("a pixel is taken")));
}

TEST(SingleTin, TheSmallestAndTheFlattestDemsAreDone) {
  const TemporaryFolder folder;
  RasterFixture tiny = hills(11);
  tiny.width = 2;
  tiny.height = 2;
  const SingleTin least = make_single_tin({.input = written(folder, tiny)});
  EXPECT_EQ(least.result.tin.triangle_count(), 2U);
  EXPECT_LE(least.result.error.largest_m, least.result.height_step_m / 2);
  for (const double height_m : {0.0, 8848.0, -10994.0}) {
    RasterFixture flat = hills(12);
    flat.value = [height_m](int, int) { return height_m; };
    SingleTinOptions options{.input = written(folder, flat)};
    const SingleTin by_default = make_single_tin(options);
    EXPECT_EQ(by_default.result.tin.triangle_count(), 2U);
    EXPECT_EQ(by_default.result.error.largest_m, 0);
    options.target.most_triangles = 100;
    EXPECT_EQ(make_single_tin(options).result.tin.triangle_count(), 2U);
  }
}

TEST(SingleTin, WhatCannotBeDoneIsRefusedWithTheRemedy) {
  const TemporaryFolder folder;
  const auto refused = [&folder](const RasterFixture& fixture, const TinTarget& target = {}) {
    return refusal([&] { make_single_tin({.input = written(folder, fixture), .target = target}); });
  };
  RasterFixture rotated = hills(13);
  rotated.geotransform = {{400000, 25, 3, 5000000, -3, -20}};
  EXPECT_THAT(refused(rotated), HasSubstr("gdalwarp"));
  RasterFixture line = hills(13);
  line.height = 1;
  EXPECT_THAT(refused(line), HasSubstr("2 x 2"));
  RasterFixture void_everywhere = hills(13);
  void_everywhere.void_value = 1;
  void_everywhere.value = [](int, int) { return 1; };
  EXPECT_THAT(refused(void_everywhere), HasSubstr("none of its pixels is valid"));
  const RasterFixture beyond{.geotransform = {{10, 1, 0, 200, 0, -1}}};
  EXPECT_THAT(refused(beyond), HasSubstr("latitude"));
  EXPECT_THAT(refused(hills(13), {.tolerance_m = 1, .most_triangles = 9}), HasSubstr("not both"));
  EXPECT_THAT(refused(hills(13), {.tolerance_m = 0}), HasSubstr("above 0"));
  EXPECT_THAT(refused(hills(13), {.tolerance_m = 1e-7}), HasSubstr("or more"));
  EXPECT_THAT(refused(hills(13), {.most_triangles = 1}), HasSubstr("give 2"));
  EXPECT_THAT(refused(hills(13), {.most_triangles = 1LL << 40}), HasSubstr("give 2"));
  EXPECT_THAT(refusal([&] {
                make_single_tin({.input = written(folder, hills(13)), .memory_bytes = 1 << 20});
              }),
              HasSubstr("-outsize"));
}

TEST(SingleTin, ATargetThatAMethodCannotReachSaysWhatWasReached) {
  const TemporaryFolder folder;
  SingleTinOptions options{.input = written(folder, hills(14))};
  options.parameters.set("g_g", ZoomSeries({20}));
  options.target.most_triangles = 50;
  EXPECT_THAT(refusal([&] { make_single_tin(options); }), HasSubstr("leaves 8"));
  options.method = Method::kPsRandom;
  options.target = {.tolerance_m = 0.01};
  options.parameters.set("p_e", ZoomSeries({1000}));
  options.parameters.set("p_b", ZoomSeries({100}));
  EXPECT_THAT(refusal([&] { make_single_tin(options); }),
              ::testing::AllOf(HasSubstr("comes no closer than"), HasSubstr("r_r=0")));
}

}  // namespace
}  // namespace qmpipe::single_tin_test
