// `verify --source`: heights against the posts, on a set built from a small raster.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "formats/bytes/errors.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/build/build.h"
#include "pipeline/verify/verify.h"
#include "tests/support/raster_fixture.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::testing::source_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

class VerifySource : public ::testing::Test {
 protected:
  static constexpr std::int32_t kDeepest = 7;

  VerifySource() {
    dem_ = file_in(inputs_, "dem.tif");
    RasterFixture fixture;
    fixture.width = 500;
    fixture.height = 400;
    fixture.geotransform = {{10, 0.01, 0, 50, 0, -0.01}};
    fixture.value = [](int c, int r) {
      return 1500 + 600 * std::sin(c / 37.0) * std::cos(r / 29.0) + 90 * std::sin(c / 4.0);
    };
    write_raster(dem_, fixture);
    BuildOptions build;
    build.input.paths = {dem_};
    build.mesh.max_zoom = kDeepest;
    build.output.path = set_.path();
    Progress progress(ProgressStyle::kSilent, nullptr);
    build_pyramid(build, progress);
  }

  verify::VerifyOptions with_source() const {
    verify::VerifyOptions options;
    options.sources = {dem_};
    options.threads = 2;
    return options;
  }
  // A tile of the deepest zoom whose posts are all on the raster.
  TileKey inner_tile() const {
    const auto degree = [](double deg) { return static_cast<std::int32_t>(deg * 128 / 180); };
    return {.zoom = kDeepest, .x = degree(180 + 12.5), .y = degree(90 + 48)};
  }

  TemporaryFolder inputs_;
  std::string dem_;
  SetFixture set_;
};

TEST_F(VerifySource, FindsEveryPostWithinTheTolerance) {
  const verify::VerifyReport report = set_.verify(with_source());
  EXPECT_THAT(report.faults, IsEmpty()) << text_of(report);
  for (const verify::ZoomReport& zoom : report.zooms) {
    ASSERT_TRUE(zoom.tolerance_m.has_value());
    EXPECT_DOUBLE_EQ(*zoom.tolerance_m, std::ldexp(15000.0, -zoom.zoom));
    EXPECT_GT(zoom.error.posts, 0);
    EXPECT_LE(zoom.error.largest_m, *zoom.tolerance_m);
    EXPECT_LE(zoom.error.mean_m(), zoom.error.rms_m());
  }
}

TEST_F(VerifySource, FindsAPostBeyondTheTolerance) {
  set_.change(inner_tile(), [](QuantizedMesh& mesh) {
    std::uint16_t& h = mesh.h[vertex_inside(mesh)];
    h = static_cast<std::uint16_t>(h < kQuantizedMax / 2 ? h + 16000 : h - 16000);
  });
  const verify::VerifyReport report = set_.verify(with_source());
  ASSERT_EQ(report.faults.size(), 1U) << text_of(report);
  EXPECT_EQ(report.faults[0].kind, FindingKind::kTolerance);
  EXPECT_EQ(report.faults[0].key, inner_tile());
  EXPECT_THAT(report.faults[0].text, HasSubstr("more than the tolerance of 117.188 m"));
  EXPECT_EQ(report.zooms.back().worst_tile, inner_tile());
  // Without the source nothing is wrong with it.
  EXPECT_THAT(set_.fault_kinds(), IsEmpty());
}

TEST_F(VerifySource, FindsATileThatTheSourceHasDataFor) {
  set_.remove_file(inner_tile());
  set_.unlist(inner_tile());
  EXPECT_THAT(set_.fault_kinds(), IsEmpty());
  EXPECT_THAT(set_.fault_kinds(with_source()), ElementsAre("missing-tile"));
}

TEST_F(VerifySource, OnlyReportsAnotherProgramsErrors) {
  set_.change_layer([](LayerJson& layer) { layer.qmpipe_json.clear(); });
  const verify::VerifyReport report = set_.verify(with_source());
  EXPECT_THAT(report.faults, IsEmpty()) << text_of(report);
  const verify::ZoomReport& deepest = report.zooms.back();
  EXPECT_FALSE(deepest.tolerance_m.has_value());
  EXPECT_EQ(deepest.source_error.posts, 0);
  // The deepest zoom of the build was reduced from a deeper one, so its posts are not the source's.
  EXPECT_GT(deepest.error.largest_m, 10);
  EXPECT_LT(deepest.error.largest_m, 300);
}

// The posts that a tile was made from are means; the source's own are farther off, and all of them count.
TEST_F(VerifySource, MeasuresTheSourcesOwnPostsBeside) {
  const verify::VerifyReport report = set_.verify(with_source());
  std::int64_t posts = 0;
  for (const verify::ZoomReport& zoom : report.zooms) {
    SCOPED_TRACE(zoom.zoom);
    EXPECT_GT(zoom.source_error.largest_m, 0);
    EXPECT_LT(zoom.source_error.rms_m(), zoom.source_error.largest_m);
    if (posts == 0) posts = zoom.source_error.posts;
    EXPECT_EQ(zoom.source_error.posts, posts);
  }
  // The deepest zoom is the sampling zoom, whose posts on sides belong to two tiles.
  const verify::ZoomReport& deepest = report.zooms.back();
  EXPECT_LT(posts, deepest.error.posts);
  EXPECT_GT(posts, deepest.error.posts * 98 / 100);
  EXPECT_NEAR(deepest.source_error.largest_m, deepest.error.largest_in_place_m, 1e-3);
}

TEST_F(VerifySource, ASpikeOfOnePixelShowsInTheSourcesErrorAlone) {
  const std::string spiky = file_in(inputs_, "spiky.tif");
  RasterFixture fixture;
  fixture.width = 500;
  fixture.height = 400;
  fixture.geotransform = {{10, 0.01, 0, 50, 0, -0.01}};
  fixture.value = [](int c, int r) { return c == 251 && r == 201 ? 5000.0 : 100.0; };
  write_raster(spiky, fixture);
  BuildOptions build;
  build.input.paths = {spiky};
  build.output.path = inputs_.path() / "spiky";
  Progress progress(ProgressStyle::kSilent, nullptr);
  build_pyramid(build, progress);
  const verify::VerifyReport report =
      verify::verify_set(*open_tile_set(build.output.path), {.sources = {spiky}}, progress);
  EXPECT_THAT(report.faults, IsEmpty()) << text_of(report);
  const verify::ZoomReport& deepest = report.zooms.back();
  EXPECT_LE(deepest.source_error.largest_m, *deepest.tolerance_m + 40);
  for (const verify::ZoomReport& zoom : report.zooms) {
    if (zoom.zoom > deepest.zoom - 3) continue;
    // Its post there is a mean over 64 or more of which one or two stand out.
    EXPECT_GT(zoom.source_error.largest_m, 3000) << zoom.zoom;
    EXPECT_LE(zoom.error.largest_m, *zoom.tolerance_m);
  }
}

TEST_F(VerifySource, MeasuresHausdorffOfTilesWithoutVoids) {
  verify::VerifyOptions options = with_source();
  options.hausdorff = verify::HausdorffMode::kMeasured;
  const verify::VerifyReport report = set_.verify(options);
  const verify::ZoomReport& deepest = report.zooms.back();
  EXPECT_GT(deepest.measured.size(), 0U);
  EXPECT_LT(std::ssize(deepest.measured), deepest.tiles);
  EXPECT_GT(deepest.mean_hausdorff().to_surfaces_m, 0);
  // Above the vertical error by what the chords of the parallels run beside the posts.
  EXPECT_LT(deepest.mean_hausdorff().to_surfaces_m, *deepest.tolerance_m * 1.25);
  EXPECT_GT(deepest.mean_hausdorff().between_points_m, deepest.mean_hausdorff().to_surfaces_m);
  EXPECT_TRUE(report.zooms.front().measured.empty());
}

TEST_F(VerifySource, SaysTheSameOnAnyNumberOfThreads) {
  verify::VerifyOptions options = with_source();
  options.hausdorff = verify::HausdorffMode::kMeasured;
  options.threads = 1;
  const std::string expected = json_of(set_.verify(options));
  options.threads = 4;
  EXPECT_EQ(json_of(set_.verify(options)), expected);
  set_.change_layer([](LayerJson& layer) { layer.qmpipe_json.clear(); });
  const std::string of_foreign = json_of(set_.verify(options));
  options.threads = 1;
  EXPECT_EQ(json_of(set_.verify(options)), of_foreign);
}

TEST_F(VerifySource, RefusesASourceThatIsNotThere) {
  verify::VerifyOptions options = with_source();
  options.sources = {file_in(inputs_, "gone.tif")};
  EXPECT_THROW(set_.verify(options), IoError);
  set_.change_layer([](LayerJson& layer) { layer.qmpipe_json.clear(); });
  EXPECT_THROW(set_.verify(options), IoError);
}

}  // namespace
}  // namespace qmpipe::testing::source_test
