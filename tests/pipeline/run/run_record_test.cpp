// A run is gone on with when, and only when, it is the same run.
#include "pipeline/run/run_record.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "formats/bytes/errors.h"
#include "pipeline/build/report_state.h"
#include "pipeline/recipe/fingerprint.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::run_record_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;

class RunRecordTest : public ::testing::Test {
 protected:
  RunRecordTest() {
    options_.input.paths = {testing::file_in(folder_, "dem.tif")};
    options_.output.path = folder_.path() / "out";
    testing::write_raster(options_.input.paths[0], {});
  }
  std::unique_ptr<RunRecord> open(Overwrite overwrite = Overwrite::kNo) const {
    return RunRecord::open(run_folder_of(options_.output.path), fingerprint_of(options_),
                           overwrite);
  }
  std::string refusal() const {
    try {
      open();
    } catch (const IoError& error) {
      return error.what();
    }
    return "";
  }
  bool has_folder() const { return folder_.has("out.qmpipe-run"); }
  static TileCheckpoint checkpoint(std::int64_t tiles) {
    return {.tiles_done = tiles, .border_segments = 0, .report_state = R"({"tiles":1})"};
  }

  TemporaryFolder folder_;
  BuildOptions options_;
};

TEST_F(RunRecordTest, AFolderWithoutAnythingDoneIsNotLeft) {
  EXPECT_FALSE(open()->resumes());
  EXPECT_FALSE(has_folder());
}

TEST_F(RunRecordTest, WhatWasDoneIsThereInTheNextRun) {
  {
    const auto record = open();
    record->set_plan(R"({"tiles":9,"recipe":{}})");
    record->add_tiles(checkpoint(3));
    record->add_tiles(checkpoint(7));
    record->add_surveyed(
        4, {.tiles = {{.key = {4, 1, 2}, .lowest_m = 1, .highest_m = 2, .valid_posts = 3}},
            .pole_heights_m = {}});
  }
  const auto record = open();
  EXPECT_TRUE(record->resumes());
  EXPECT_EQ(record->tiles().tiles_done, 7);
  EXPECT_EQ(record->tiles().report_state, R"({"tiles":1})");
  EXPECT_TRUE(record->is_surveyed(4));
  EXPECT_FALSE(record->is_surveyed(3));
  EXPECT_EQ(record->coarsest_surveyed(), 4);
  EXPECT_EQ(record->surveyed(4, TilingScheme(Projection::kGeodetic)).tiles.at(0).valid_posts, 3);
  record->set_plan(R"({"recipe":{},"tiles":9})");
  EXPECT_THROW(record->set_plan(R"({"recipe":{},"tiles":8})"), IoError);
  record->finish(false);
  EXPECT_FALSE(has_folder());
}

TEST(RunFolder, StandsBesideTheOutputHoweverThatIsWritten) {
  const std::filesystem::path here = std::filesystem::current_path();
  EXPECT_EQ(run_folder_of("tiles"), here / "tiles.qmpipe-run");
  EXPECT_EQ(run_folder_of("tiles/"), here / "tiles.qmpipe-run");
  EXPECT_EQ(run_folder_of("a/../tiles/."), here / "tiles.qmpipe-run");
  EXPECT_EQ(run_folder_of("."), here.string() + ".qmpipe-run");
  EXPECT_EQ(run_folder_of("/data/tiles"), "/data/tiles.qmpipe-run");
}

TEST_F(RunRecordTest, KilledWhileItClearsUpItKeepsItsTilesAndSurveysAgain) {
  open()->add_surveyed(4, {});
  open()->add_tiles({.tiles_done = 9, .border_segments = 0, .report_state = "{}"});
  folder_.put("out.qmpipe-run/lattice-000001.h5", "the segment before it is gone already");
  (*Journal::open(folder_.path() / "out.qmpipe-run" / "journal"))
      ->append(R"({"stores_removed":true})");
  {
    const auto record = open();
    EXPECT_TRUE(record->resumes());
    EXPECT_EQ(record->tiles().tiles_done, 9);
    EXPECT_FALSE(record->is_surveyed(4));
    EXPECT_FALSE(folder_.has("out.qmpipe-run/lattice-000001.h5"));
    EXPECT_FALSE(folder_.has("out.qmpipe-run/survey-04.qms"));
    record->add_surveyed(5, {});
  }
  EXPECT_TRUE(open()->is_surveyed(5)) << "what comes after that line counts again";
}

TEST_F(RunRecordTest, WhatElseStandsInTheFolderStays) {
  folder_.put("out.qmpipe-run/notes.txt", "mine");
  folder_.put("out.qmpipe-run/data/lattice-000000.h5", "mine too");
  folder_.put("out.qmpipe-run/lattice-000003.h5", "left by a run that could not clear up");
  open();
  EXPECT_FALSE(folder_.has("out.qmpipe-run/lattice-000003.h5"));
  open()->add_tiles(checkpoint(3));
  EXPECT_TRUE(folder_.has("out.qmpipe-run/journal"));
  open(Overwrite::kYes)->finish(false);
  EXPECT_FALSE(folder_.has("out.qmpipe-run/journal"));
  EXPECT_EQ(folder_.get("out.qmpipe-run/notes.txt"), "mine");
  EXPECT_EQ(folder_.get("out.qmpipe-run/data/lattice-000000.h5"), "mine too");
}

TEST_F(RunRecordTest, EveryParameterThatDecidesBytesIsNamedWhenItDiffers) {
  open()->add_tiles(checkpoint(3));
  const BuildOptions same = options_;
  const auto refusal_with = [this, &same](const auto& change) {
    options_ = same;
    change(options_);
    return refusal();
  };
  const std::vector<std::pair<const char*, void (*)(BuildOptions&)>> changes = {
      {"--source-crs", [](BuildOptions& o) { o.input.source_crs = "EPSG:4326"; }},
      {"--resampling", [](BuildOptions& o) { o.input.resampling = Resampling::kCubic; }},
      {"--scheme", [](BuildOptions& o) { o.mesh.projection = Projection::kMercator; }},
      {"--min-zoom", [](BuildOptions& o) { o.mesh.min_zoom = 1; }},
      {"--max-zoom was \"from the pixels\", and is 3 now",
       [](BuildOptions& o) { o.mesh.max_zoom = 3; }},
      {"g_e (--tolerance) was \"15000/2\", and is \"2.5\" now",
       [](BuildOptions& o) { o.mesh.parameters.set("g_e", ZoomSeries({2.5})); }},
      {"--tolerance-at", [](BuildOptions& o) { o.mesh.tolerance_at_m[3] = 7; }},
      {"g_g", [](BuildOptions& o) { o.mesh.parameters.set("g_g", ZoomSeries({4})); }},
      {"--method", [](BuildOptions& o) { o.mesh.method = Method::kPsGrid; }},
      {"--reduce", [](BuildOptions& o) { o.mesh.reduction = Reduction::kMax; }},
      {"--nodata", [](BuildOptions& o) { o.mesh.voids.kind = VoidPolicy::Kind::kHeight; }},
      {"--gzip was 7, and is \"none\" now", [](BuildOptions& o) { o.encode.gzip_level.reset(); }},
      {"normals", [](BuildOptions& o) { o.encode.normals = false; }},
  };
  for (const auto& [name, change] : changes) EXPECT_THAT(refusal_with(change), HasSubstr(name));
  EXPECT_EQ(refusal_with([](BuildOptions& o) {
              o.run.threads = 7;
              o.run.memory_bytes = 1LL << 30U;
              o.run.checkpoint_s = 1;
              o.output.attribution = "other";
            }),
            "");
}

TEST_F(RunRecordTest, AChangedInputIsNamed) {
  open()->add_tiles(checkpoint(3));
  const std::filesystem::path dem = options_.input.paths[0];
  const auto changed = std::filesystem::last_write_time(dem);
  std::filesystem::last_write_time(dem, changed + std::chrono::milliseconds(5));
  EXPECT_THAT(refusal(), HasSubstr("dem.tif has changed"));
  std::filesystem::last_write_time(dem, changed);
  EXPECT_EQ(refusal(), "");
  options_.input.paths.push_back(testing::file_in(folder_, "second.tif"));
  testing::write_raster(options_.input.paths[1], {});
  EXPECT_THAT(refusal(), HasSubstr("the inputs were"));
  EXPECT_TRUE(open(Overwrite::kYes) != nullptr);
}

TEST_F(RunRecordTest, WhatAMosaicReadsIsPartOfTheInput) {
  folder_.put("mosaic.vrt", R"(<VRTDataset rasterXSize="4" rasterYSize="3">
    <SRS>EPSG:4326</SRS><GeoTransform>10, 1, 0, 50, 0, -1</GeoTransform>
    <VRTRasterBand dataType="Float32" band="1"><SimpleSource>
    <SourceFilename relativeToVRT="1">dem.tif</SourceFilename></SimpleSource></VRTRasterBand>
    </VRTDataset>)");
  const std::string mosaic = (folder_.path() / "mosaic.vrt").string();
  options_.input.paths = {mosaic};
  const std::string before = fingerprint_of(options_);
  EXPECT_THAT(before, HasSubstr("dem.tif"));
  const std::filesystem::path dem = folder_.path() / "dem.tif";
  std::filesystem::last_write_time(dem,
                                   std::filesystem::last_write_time(dem) - std::chrono::hours(1));
  EXPECT_THAT(fingerprint_differences(before, fingerprint_of(options_)),
              ElementsAre(HasSubstr("dem.tif has changed")));
}

TEST(Fingerprint, AForeignOneIsRefused) {
  for (const char* text : {"", "7", "{}", R"({"program_version":1,"inputs":3,"parameters":[]})",
                           R"({"program_version":"0","inputs":[{}],"parameters":{}})"}) {
    const std::string now =
        R"({"program_version":"0","inputs":[{"name":"a","files":{}}],"parameters":{}})";
    EXPECT_THAT(fingerprint_differences(text, now), ::testing::Not(IsEmpty())) << text;
  }
}

TEST(ReportState, GivesBackTheSumsToTheLastBit) {
  BuildReport report;
  for (std::int32_t zoom = 2; zoom < 5; ++zoom) {
    BuiltZoom& row = report.zooms.emplace_back();
    row.zoom = zoom;
    row.tiles = 17 + zoom;
    row.error.posts = 12345678901;
    row.error.largest_m = 1.0 / 3 + zoom;
    row.error.largest_in_place_m = 2.0 / 3 + zoom;
    row.error.sum_m = 1e9 / 7;
    row.error.sum_of_squares_m2 = 2e-17;
    row.error.worst = {.i = 255, .j = zoom};
    row.seconds = {0.1, 0.2, 0.3, 0.4, 1.0 / 9};
  }
  report.tiles = 60;
  report.content_hash = 0xFEDCBA9876543210ULL;
  BuildReport empty = report;
  for (BuiltZoom& row : empty.zooms) {
    const std::int32_t zoom = row.zoom;
    row = BuiltZoom();
    row.zoom = zoom;
  }
  empty.tiles = 0;
  empty.content_hash = 0;
  const std::string state = write_report_state(report);
  const auto read = with_report_state(empty, state);
  ASSERT_TRUE(read) << read.error().message;
  EXPECT_EQ(write_report_state(*read), state);
  EXPECT_EQ(read->content_hash, report.content_hash);
  EXPECT_EQ(read->zooms[1].error.sum_of_squares_m2, 2e-17);
  EXPECT_EQ(read->zooms[2].error.largest_m, 1.0 / 3 + 4);
  EXPECT_EQ(read->zooms[2].error.largest_in_place_m, 2.0 / 3 + 4);
}

TEST(ReportState, AForeignOneIsRefused) {
  BuildReport empty;
  empty.zooms.emplace_back().zoom = 3;
  const std::string good = write_report_state(empty);
  ASSERT_TRUE(with_report_state(empty, good));
  BuildReport other = empty;
  other.zooms[0].zoom = 4;
  EXPECT_FALSE(with_report_state(other, good));
  for (const char* text : {"", "[]", "{}", R"({"zooms":[7]})", R"({"zooms":[{"zoom":3}]})"}) {
    EXPECT_FALSE(with_report_state(empty, text)) << text;
  }
}

}  // namespace
}  // namespace qmpipe::run_record_test
