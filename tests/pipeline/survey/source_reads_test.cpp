// How often the survey decodes the blocks of its sources, and that the lattice does not depend on
// it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <oneapi/tbb/global_control.h>

#include <cmath>
#include <filesystem>

#include "formats/bytes/errors.h"
#include "pipeline/survey/sampling_order.h"
#include "pipeline/survey/survey.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::source_reads_test {
namespace {

using testing::RasterFixture;
using testing::TemporaryFolder;

// At this pixel size the posts of zoom 7 lie 0.55 pixels apart: about a hundred blocks of posts.
RasterFixture hills(const std::vector<std::string>& creation_options, int more_bands = 0) {
  RasterFixture fixture{.width = 1500, .height = 1100, .type = "Int16"};
  fixture.geotransform = {{20, 0.01, 0, 50, 0, -0.01}};
  fixture.creation_options = creation_options;
  fixture.more_bands = more_bands;
  fixture.value = [](int c, int r) {
    return std::round(900 * std::sin(c / 31.0) * std::cos(r / 23.0));
  };
  return fixture;
}

Survey survey_of(const std::string& path, std::int32_t threads, std::int64_t cache_bytes) {
  // More threads than the machine has cores, as in a build.
  const tbb::global_control workers(tbb::global_control::max_allowed_parallelism, 8);
  Progress progress(ProgressStyle::kSilent, nullptr);
  const SurveyChoice choice{.inputs = {path}, .threads = threads};
  const MemoryShare memory = {
      .plan = {.source_cache_bytes = cache_bytes, .sampling_threads = threads}};
  return run_survey(choice, memory, {}, describe_inputs(choice), nullptr, progress);
}

std::int64_t comfortable_bytes(const std::string& path, std::int32_t threads) {
  const std::vector<RasterInfo> infos = describe_inputs({.inputs = {path}});
  const Lattice lattice(TilingScheme(Projection::kGeodetic), chosen_sampling_zoom({}, infos));
  return front_bytes(lattice, infos, threads, lattice.scheme().columns(lattice.zoom()));
}

// The posts on the raster and a few around it.
PostWindow window_around(const Lattice& lattice) {
  return {.i0 = static_cast<std::int64_t>(lattice.column_at(19)),
          .j0 = static_cast<std::int64_t>(lattice.row_at(38)),
          .width_posts = static_cast<std::int32_t>(17 / lattice.column_spacing_deg()),
          .height_posts = static_cast<std::int32_t>(13 / lattice.column_spacing_deg())};
}

std::vector<float> posts_of(const Survey& survey) {
  const Lattice lattice(survey.scheme, survey.sampling_zoom);
  const PostWindow window = window_around(lattice);
  std::vector<float> heights_m(window.size());
  survey.store->read(lattice, window, heights_m);
  return heights_m;
}

// The same, straight from a sampler that shares nothing.
std::vector<float> sampled_posts(const std::string& path, const Survey& survey) {
  const Lattice lattice(survey.scheme, survey.sampling_zoom);
  const PostWindow window = window_around(lattice);
  std::vector<float> heights_m(window.size());
  Sampler(testing::pool_of({path}), Resampling::kBilinear).sample(lattice, window, heights_m);
  return heights_m;
}

bool are_equal(const std::vector<float>& a, const std::vector<float>& b) {
  return std::equal(a.begin(), a.end(), b.begin(), b.end(),
                    [](float x, float y) { return x == y || (std::isnan(x) && std::isnan(y)); });
}

class SourceReadsTest : public ::testing::Test {
 protected:
  std::string write(const RasterFixture& fixture) {
    std::string path = testing::file_in(folder_, std::to_string(++count_) + ".tif");
    testing::write_raster(path, fixture);
    return path;
  }

  std::vector<std::string> files() {
    return {write(hills({"TILED=YES", "COMPRESS=DEFLATE"})),
            write(hills({"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=512"})),
            write(hills({"COMPRESS=DEFLATE"})),
            write(hills({"BLOCKYSIZE=1", "COMPRESS=DEFLATE"})),
            write(hills({"BLOCKYSIZE=1100", "COMPRESS=DEFLATE"})),
            write(hills({"TILED=YES", "COMPRESS=DEFLATE", "INTERLEAVE=PIXEL"}, 2))};
  }

  TemporaryFolder folder_;
  int count_ = 0;
};

TEST_F(SourceReadsTest, EveryBlockIsDecodedAboutOnceOnAnyNumberOfThreads) {
  for (const std::string& path : files()) {
    const RasterInfo info = RasterSource::open(path)->info();
    const std::int64_t blocks = ((info.width + info.blocks.width - 1) / info.blocks.width) *
                                ((info.height + info.blocks.height - 1) / info.blocks.height);
    std::vector<float> sampled;
    for (const std::int32_t threads : {1, 2, 8}) {
      SCOPED_TRACE(std::to_string(info.blocks.width) + " x " + std::to_string(info.blocks.height) +
                   " on " + std::to_string(threads) + " threads");
      // How far threads stand apart is the system's to say: they get what a build gives them.
      const std::int64_t cache_bytes = threads == 1 ? comfortable_bytes(path, 1) : 64LL << 20U;
      const Survey survey = survey_of(path, threads, cache_bytes);
      EXPECT_EQ(survey.source_reads.blocks, blocks);
      EXPECT_LE(survey.source_reads.decoded_per_block(), 1.05);
      if (sampled.empty()) sampled = sampled_posts(path, survey);
      EXPECT_TRUE(are_equal(posts_of(survey), sampled));
    }
  }
}

TEST_F(SourceReadsTest, WithHardlyAnyCacheItEndsAndSaysHowOften) {
  for (const std::string& path : files()) {
    const RasterInfo info = RasterSource::open(path)->info();
    SCOPED_TRACE(std::to_string(info.blocks.width) + " x " + std::to_string(info.blocks.height));
    const Survey roomy = survey_of(path, 2, 1LL << 30U);
    const Survey tight = survey_of(path, 2, 1);
    EXPECT_EQ(tight.source_reads.blocks, roomy.source_reads.blocks);
    EXPECT_EQ(roomy.source_reads.decoded_per_block(), 1);
    if (tight.source_reads.blocks > 1) {
      EXPECT_GT(tight.source_reads.decoded_per_block(), 1.5);
    }
    EXPECT_TRUE(are_equal(posts_of(tight), posts_of(roomy)));
  }
}

TEST_F(SourceReadsTest, NarrowStripsDecodeLittleMore) {
  const std::string path =
      write(hills({"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=128", "COMPRESS=DEFLATE"}));
  const Survey survey = survey_of(path, 2, comfortable_bytes(path, 2) / 2);
  EXPECT_LE(survey.source_reads.decoded_per_block(), 1.4);
}

TEST_F(SourceReadsTest, ATruncatedFileEndsTheSurveyOnAllThreads) {
  for (const std::string& path : files()) {
    std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
    try {
      survey_of(path, 8, 1LL << 30U);
      ADD_FAILURE() << path << " was read";
    } catch (const IoError& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr(path));
    }
  }
}

}  // namespace
}  // namespace qmpipe::source_reads_test
