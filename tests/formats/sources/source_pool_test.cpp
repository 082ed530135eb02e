#include "formats/sources/source_pool.h"

#include <gtest/gtest.h>
#include <sys/resource.h>

#include <algorithm>
#include <filesystem>
#include <random>

#include "formats/bytes/errors.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::source_pool_test {
namespace {

namespace fs = std::filesystem;

constexpr int kRasters = 12;

// Side by side from west to east; the k-th holds 100 k + 10 row + column.
class SourcePoolTest : public ::testing::Test {
 protected:
  SourcePoolTest() {
    for (int k = 0; k < kRasters; ++k) {
      RasterFixture fixture;
      fixture.geotransform = {{10.0 + 4 * k, 1, 0, 50, 0, -1}};
      // Every other one needs a transformation.
      if (k % 2 == 1) fixture.crs = "EPSG:4267";
      fixture.value = [k](int c, int r) { return 100.0 * k + 10.0 * r + c; };
      paths_.push_back(file_in(folder_, "r" + std::to_string(k) + ".tif"));
      write_raster(paths_.back(), fixture);
      infos_->push_back(RasterSource::open(paths_.back())->info());
    }
  }

  SourcePool pool(std::size_t most_open) const { return {infos_, {}, most_open}; }
  // Of this test's rasters.
  std::ptrdiff_t open_files() const {
    const fs::path folder = fs::canonical(fs::path(paths_.front()).parent_path());
    return std::count_if(fs::directory_iterator("/proc/self/fd"), fs::directory_iterator(),
                         [&folder](const fs::directory_entry& entry) {
                           std::error_code code;
                           return fs::read_symlink(entry, code).parent_path() == folder;
                         });
  }

  TemporaryFolder folder_;
  std::vector<std::string> paths_;
  std::shared_ptr<std::vector<RasterInfo>> infos_ = std::make_shared<std::vector<RasterInfo>>();
};

TEST_F(SourcePoolTest, ReadsTheSameHoweverFewAreOpen) {
  const unsigned seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 dice(seed);
  for (const std::size_t most_open : {1U, 3U, 12U}) {
    SourcePool few = pool(most_open);
    EXPECT_EQ(few.size(), kRasters);
    for (int turn = 0; turn < 60; ++turn) {
      const std::size_t number = dice() % kRasters;
      const RasterSource& source = few.source(number);
      EXPECT_EQ(source.info().path, paths_[number]);
      EXPECT_EQ(read_all(source).front(), 100.0 * static_cast<double>(number));
      const double longitude_deg = 11.5 + 4 * static_cast<double>(number);
      const auto place = few.grid(number).pixel_at(longitude_deg, 48.5);
      ASSERT_TRUE(place);
      EXPECT_NEAR(place->column, 1.5, 0.01);
      EXPECT_LE(open_files(), static_cast<std::ptrdiff_t>(most_open));
    }
  }
  EXPECT_EQ(open_files(), 0);
}

TEST_F(SourcePoolTest, OpensOnlyWhatIsAskedForAndKeepsWhatWasAskedForLast) {
  SourcePool three = pool(3);
  EXPECT_EQ(open_files(), 0);
  const RasterSource* const first = &three.source(0);
  three.source(1);
  EXPECT_EQ(open_files(), 2);
  three.source(2);
  EXPECT_EQ(&three.source(0), first);
  // The place is that of 1, which was asked for longest ago.
  three.source(3);
  EXPECT_EQ(&three.source(0), first);
}

TEST_F(SourcePoolTest, ARasterThatIsAnotherNowIsNotRead) {
  SourcePool one = pool(1);
  one.source(0);
  RasterFixture wider{.width = 5};
  write_raster(paths_[1], wider);
  EXPECT_THROW(one.source(1), IoError);
  EXPECT_EQ(read_all(one.source(2)).front(), 200);
  fs::remove(paths_[3]);
  EXPECT_THROW(one.source(3), IoError);
  EXPECT_EQ(read_all(one.source(0)).front(), 0);
}

TEST(SourcesOpenAtOnce, StayBelowTheLimitOfTheProcess) {
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_NOFILE, &before), 0);
  const auto with = [&before](rlim_t limit, std::int32_t threads) {
    rlimit fewer = before;
    fewer.rlim_cur = std::min<rlim_t>(limit, before.rlim_max);
    EXPECT_EQ(setrlimit(RLIMIT_NOFILE, &fewer), 0);
    return sources_open_at_once(threads);
  };
  EXPECT_EQ(with(1024, 2), 64);
  EXPECT_EQ(with(1024, 8), 34);
  EXPECT_EQ(with(1024, 80), 4);
  EXPECT_EQ(with(100, 2), 4);
  ASSERT_EQ(setrlimit(RLIMIT_NOFILE, &before), 0);
}

}  // namespace
}  // namespace qmpipe::testing::source_pool_test
