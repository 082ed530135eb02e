// The whole build on small rasters: the same bytes whatever the threads and the memory, nothing
// wrong by `verify`, and a clear end when it cannot go on.
#include "pipeline/build/build.h"

#include <gtest/gtest.h>

#include <atomic>
#include <cmath>
#include <map>
#include <numbers>
#include <random>

#include "formats/bytes/errors.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/verify/verify.h"
#include "tests/support/build_fixture.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::build_test {
namespace {

using testing::BuildTest;
using testing::hilly_raster;
using testing::RasterFixture;
using testing::TemporaryFolder;

TEST_F(BuildTest, BytesDoNotDependOnThreadsOrMemory) {
  const std::string dem = write(hilly_raster(1, 178.6, 3.1, 0.01));
  BuildOptions options = options_for({dem}, "reference");
  options.run.threads = 1;
  run(options);
  const auto reference = contents(options);
  ASSERT_GT(reference.size(), 20U);
  struct Variant {
    std::int32_t threads;
    std::int64_t memory_bytes;
  };
  for (const Variant& variant : {Variant{2, 0}, Variant{8, 0}, Variant{80, 0},
                                 Variant{1, 130LL << 20U}, Variant{8, 130LL << 20U}}) {
    SCOPED_TRACE(std::to_string(variant.threads) + " threads, " +
                 std::to_string(variant.memory_bytes) + " bytes");
    BuildOptions other = options;
    other.output.path = folder_.path() / "other";
    other.output.overwrite = Overwrite::kYes;
    other.run.threads = variant.threads;
    other.run.memory_bytes = variant.memory_bytes;
    run(other);
    EXPECT_EQ(contents(other), reference);
  }
}

TEST_F(BuildTest, LatticeOnDiskGivesTheSameBytesAndLeavesNothing) {
  RasterFixture fixture = hilly_raster(2, 10, 45, 0.0008);
  fixture.width = 4000;
  fixture.height = 3000;
  fixture.type = "Int16";
  fixture.creation_options = {"TILED=YES", "COMPRESS=DEFLATE"};
  BuildOptions options = options_for({write(fixture)}, "in-memory");
  run(options);
  const auto reference = contents(options);
  options.output.path = folder_.path() / "on-disk/";
  options.run.memory_bytes = 210LL << 20U;
  const BuildResult result = run(options);
  EXPECT_EQ(contents(options), reference);
  EXPECT_GT(result.estimate.store_bytes, 0) << "nothing was kept on disk";
  EXPECT_LE(result.report.expected_peak_bytes, options.run.memory_bytes);
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "on-disk.qmpipe-run"));
}

TEST_F(BuildTest, VerifyFindsNothingInAnyScheme) {
  std::uint32_t seed = 10;
  for (const Projection projection : {Projection::kGeodetic, Projection::kMercator}) {
    for (const Reduction reduction :
         {Reduction::kMean, Reduction::kSubsample, Reduction::kMax, Reduction::kMin}) {
      SCOPED_TRACE("seed " + std::to_string(++seed) + ", " + name_of(reduction));
      const std::string dem = write(hilly_raster(seed, 178.6, 41.3, 0.01));
      BuildOptions options = options_for({dem}, "tiles");
      options.output.overwrite = Overwrite::kYes;
      options.mesh.projection = projection;
      options.mesh.reduction = reduction;
      options.mesh.voids.kind = seed % 2 == 0 ? VoidPolicy::Kind::kPull : VoidPolicy::Kind::kHeight;
      run(options);
      expect_sound(options);
    }
  }
}

TEST_F(BuildTest, WholeGlobeClosesAtThePolesAndTheAntimeridian) {
  RasterFixture fixture;
  fixture.width = 360;
  fixture.height = 180;
  fixture.geotransform = {{-180, 1, 0, 90, 0, -1}};
  fixture.value = [](int c, int r) {
    return 3000 * std::sin(c * std::numbers::pi / 60) * std::sin(r * std::numbers::pi / 45);
  };
  for (const Projection projection : {Projection::kGeodetic, Projection::kMercator}) {
    BuildOptions options = options_for({write(fixture)}, "globe");
    options.output.overwrite = Overwrite::kYes;
    options.mesh.projection = projection;
    options.mesh.max_zoom = 2;
    const BuildResult result = run(options);
    EXPECT_EQ(result.report.tiles, projection == Projection::kGeodetic ? 2 + 8 + 32 : 1 + 4 + 16);
    expect_sound(options);
  }
}

TEST_F(BuildTest, TolerancesOfSingleZoomsHold) {
  const std::string dem = write(hilly_raster(3, 10, 45, 0.01));
  BuildOptions options = options_for({dem}, "tiles");
  options.mesh.tolerance_at_m = {{6, 40.0}, {7, 4.5}};
  const BuildResult result = run(options);
  expect_sound(options);
  for (const BuiltZoom& zoom : result.report.zooms) {
    EXPECT_LE(zoom.error.largest_m, zoom.tolerance_m) << "zoom " << zoom.zoom;
    if (zoom.zoom == 7) {
      EXPECT_EQ(zoom.tolerance_m, 4.5);
    }
  }
}

TEST_F(BuildTest, ReportAgreesWithVerify) {
  const std::string dem = write(hilly_raster(4, 10, 45, 0.01));
  BuildOptions options = options_for({dem}, "tiles");
  const BuildResult built = run(options);
  Progress progress(ProgressStyle::kSilent, nullptr);
  verify::VerifyOptions check;
  check.sources = {dem};
  const verify::VerifyReport verified =
      verify::verify_set(*open_tile_set(options.output.path), check, progress);
  ASSERT_EQ(built.report.zooms.size(), verified.zooms.size());
  for (std::size_t k = 0; k < verified.zooms.size(); ++k) {
    EXPECT_EQ(built.report.zooms[k].tiles, verified.zooms[k].tiles);
    EXPECT_EQ(built.report.zooms[k].vertices, verified.zooms[k].vertices);
    EXPECT_EQ(built.report.zooms[k].triangles, verified.zooms[k].triangles);
    EXPECT_EQ(built.report.zooms[k].stored_bytes, verified.zooms[k].stored_bytes);
    EXPECT_DOUBLE_EQ(built.report.zooms[k].error.largest_m, verified.zooms[k].error.largest_m);
    EXPECT_EQ(built.report.zooms[k].error.posts, verified.zooms[k].error.posts);
  }
}

TEST_F(BuildTest, FirstValidInputWins) {
  RasterFixture low = hilly_raster(5, 10, 45, 0.01);
  low.value = [](int c, int) { return c < 150 ? 100.0 : -9999.0; };
  RasterFixture high = low;
  high.value = [](int, int) { return 700.0; };
  const std::string first = write(low, "low.tif");
  const std::string second = write(high, "high.tif");
  BuildOptions options = options_for({first, second}, "both");
  const BuildResult result = run(options);
  expect_sound(options);
  EXPECT_LE(result.report.zooms.back().error.largest_m, result.report.zooms.back().tolerance_m);
}

TEST_F(BuildTest, DryRunWritesNothing) {
  BuildOptions options = options_for({write(hilly_raster(6, 10, 45, 0.01))}, "nothing");
  options.run.dry_run = true;
  const BuildResult result = run(options);
  EXPECT_GT(result.estimate.tiles, 0);
  EXPECT_GT(result.estimate.bytes, 0);
  EXPECT_FALSE(std::filesystem::exists(options.output.path));
}

// Sea beside mountains, rims of the data, a hole: what tiles drawn blindly would miss or count twice.
TEST_F(BuildTest, EstimateIsNearTheResult) {
  std::map<std::string, std::string> dems = {
      {"hills with a hole", write(hilly_raster(7, 10, 45, 0.01))}};
  RasterFixture coast = hilly_raster(8, 10, 45, 0.01);
  coast.width = 900;
  coast.height = 700;
  const auto hills = coast.value;
  coast.value = [hills](int c, int r) { return c + r / 3 < 700 ? 0.0 : hills(c, r); };
  dems.emplace("a coast", write(coast, "coast.tif"));
  for (const char* name :
       {"FR+IT.nc", "N43E007.hgt.zip", "portland-ned-nodata.tif", "Kilauea.utm.nc"}) {
    if (const auto path = testing::real_data(name)) dems.emplace(name, *path);
  }
  for (const auto& [name, path] : dems) {
    const BuildResult result = run(options_for({path}, "tiles of " + name));
    const auto real = static_cast<double>(result.report.stored_bytes);
    EXPECT_EQ(result.estimate.tiles, result.report.tiles) << name;
    EXPECT_NEAR(static_cast<double>(result.estimate.bytes) / real, 1, 0.25) << name;
    std::int64_t tiles = 0;
    for (const ZoomEstimate& zoom : result.estimate.zooms) tiles += zoom.tiles;
    EXPECT_EQ(tiles, result.report.tiles) << name;
  }
}

// Where there are no more tiles than are looked at anyway, only their neighbours' borders are missing.
TEST_F(BuildTest, EstimateOfAFewTilesLeavesNothingToChance) {
  BuildOptions options = options_for({write(hilly_raster(12, 10, 45, 0.01))}, "tiles");
  options.mesh.max_zoom = 3;
  const BuildResult result = run(options);
  ASSERT_LE(result.report.tiles, 10);
  EXPECT_NEAR(static_cast<double>(result.estimate.bytes),
              static_cast<double>(result.report.stored_bytes),
              0.03 * static_cast<double>(result.report.stored_bytes));
}

TEST_F(BuildTest, TooLittleMemoryIsRefusedWithTheLeastThatWorks) {
  BuildOptions options = options_for({write(hilly_raster(8, 10, 45, 0.01))}, "tiles");
  options.run.memory_bytes = 1 << 20;
  try {
    run(options);
    FAIL() << "a build in 1 MiB";
  } catch (const UsageError& error) {
    const std::string text = error.what();
    const auto at = text.find(" needs ");
    ASSERT_NE(at, std::string::npos) << text;
    options.run.memory_bytes = std::stoll(text.substr(at + 7)) << 20U;
  }
  run(options);
  expect_sound(options);
}

TEST_F(BuildTest, StopEndsWithoutLayerJson) {
  BuildOptions options = options_for({write(hilly_raster(9, 10, 45, 0.01))}, "tiles");
  std::atomic<bool> stop = true;
  Progress progress(ProgressStyle::kSilent, &stop);
  EXPECT_THROW(build_pyramid(options, progress), Interrupted);
  EXPECT_FALSE(std::filesystem::exists(options.output.path / "layer.json"));
}

TEST_F(BuildTest, AllVoidInputIsAnErrorThatSaysSo) {
  RasterFixture fixture = hilly_raster(11, 10, 45, 0.01);
  for (const double value : {-9999.0, std::nan("")}) {
    fixture.value = [value](int, int) { return value; };
    BuildOptions options = options_for({write(fixture)}, "tiles");
    options.output.overwrite = Overwrite::kYes;
    try {
      run(options);
      FAIL() << "a build from nothing";
    } catch (const IoError& error) {
      EXPECT_NE(std::string(error.what()).find("no valid post"), std::string::npos);
    }
  }
}

TEST_F(BuildTest, OnePixelRasterGivesASoundSet) {
  RasterFixture fixture;
  fixture.width = 1;
  fixture.height = 1;
  fixture.geotransform = {{10, 0.5, 0, 45, 0, -0.5}};
  fixture.value = [](int, int) { return 321.0; };
  BuildOptions options = options_for({write(fixture)}, "tiles");
  run(options);
  expect_sound(options);
}

TEST_F(BuildTest, ContradictoryOptionsAreAllNamed) {
  BuildOptions options = options_for({"none.tif"}, "tiles");
  options.mesh.min_zoom = 5;
  options.mesh.max_zoom = 3;
  options.mesh.tolerance_at_m[4] = -1;
  options.mesh.stop = Stop::kEdges;
  options.encode.gzip_level = 99;
  options.run.threads = 0;
  EXPECT_EQ(violated_rules(options).size(), 5U);
}

TEST_F(BuildTest, RealDemsAreSound) {
  int found = 0;
  for (const std::string name : {"HI_topo_02.nc", "portland-ned-nodata.tif", "FR+IT.nc"}) {
    const auto path = testing::real_data(name);
    if (!path) continue;
    ++found;
    SCOPED_TRACE(name);
    BuildOptions options = options_for({*path}, name);
    run(options);
    expect_sound(options);
  }
  if (found == 0) GTEST_SKIP() << "no real DEMs: set QMPIPE_DATA";
}

}  // namespace
}  // namespace qmpipe::build_test
