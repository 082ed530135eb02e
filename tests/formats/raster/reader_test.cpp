// Both ways of reading a raster, straight from GDAL and through a cache of decoded blocks, give the
// same heights, whatever the file is like inside.
#include "formats/raster/reader.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <cmath>
#include <filesystem>
#include <random>
#include <thread>

#include "formats/bytes/errors.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::reader_test {
namespace {

using ::testing::HasSubstr;

struct Layout {
  std::string name;
  std::vector<std::string> creation_options;
  int more_bands = 0;
};

std::vector<Layout> layouts() {
  return {{"strips", {"COMPRESS=DEFLATE"}},
          {"rows", {"BLOCKYSIZE=1", "COMPRESS=DEFLATE"}},
          {"odd strips", {"BLOCKYSIZE=37"}},
          {"one block", {"BLOCKYSIZE=260", "COMPRESS=LZW"}},
          {"tiles", {"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=128", "COMPRESS=DEFLATE"}},
          {"small tiles", {"TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=32", "COMPRESS=DEFLATE"}},
          {"a tile larger than the raster", {"TILED=YES", "BLOCKXSIZE=512", "BLOCKYSIZE=512"}},
          {"pixel-interleaved", {"TILED=YES", "BLOCKXSIZE=128", "BLOCKYSIZE=144"}, 3},
          {"alpha", {"TILED=YES", "COMPRESS=DEFLATE", "ALPHA=YES"}, 1},
          {"alpha in rows", {"BLOCKYSIZE=1", "ALPHA=YES", "INTERLEAVE=BAND"}, 1}};
}

RasterFixture fixture_of(const std::string& type, const Layout& layout, bool has_mask,
                         std::uint64_t seed) {
  RasterFixture fixture{.width = 307, .height = 260, .type = type};
  fixture.geotransform = {{10, 0.1, 0, 50, 0, -0.1}};
  fixture.void_value = 13;
  fixture.scale = 0.3;
  fixture.offset = -5;
  fixture.creation_options = layout.creation_options;
  fixture.more_bands = layout.more_bands;
  fixture.value = [seed](int c, int r) {
    std::minstd_rand random(
        static_cast<std::uint32_t>(seed * 7919 + static_cast<std::uint64_t>(r * 307 + c)));
    random.discard(2);
    return static_cast<double>(random() % 127);
  };
  if (!has_mask) return fixture;
  for (int k = 0; k < fixture.width * fixture.height; ++k) {
    fixture.mask.push_back(k % 11 == 0 ? 0 : 255);
  }
  return fixture;
}

// Of a picture too.
HeightOptions first_band() {
  HeightOptions options;
  options.band = 1;
  return options;
}

std::unique_ptr<RasterSource> open_cached(const std::string& path,
                                          const std::shared_ptr<SourceBlockCache>& cache) {
  return RasterSource::open(path, {.heights = first_band(), .cache = cache});
}

// Equal bits, and NaN where the other is NaN.
::testing::AssertionResult agree(const std::vector<double>& a, const std::vector<double>& b) {
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k] == b[k] || (std::isnan(a[k]) && std::isnan(b[k]))) continue;
    return ::testing::AssertionFailure() << "value " << k << ": " << a[k] << " and " << b[k];
  }
  return ::testing::AssertionSuccess();
}

void compare(const std::string& path, std::uint64_t seed, std::int64_t bound_bytes) {
  const auto cache = std::make_shared<SourceBlockCache>(bound_bytes);
  const auto plain = RasterSource::open(path, {.heights = first_band()});
  const auto cached = open_cached(path, cache);
  const RasterInfo& info = plain->info();
  std::mt19937_64 random(seed);
  const auto below = [&random](std::int64_t end) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(end));
  };
  for (int k = 0; k < 20; ++k) {
    PixelWindow window{.column0 = below(info.width), .row0 = below(info.height)};
    window.width = 1 + below(info.width - window.column0);
    window.height = 1 + below(info.height - window.row0);
    std::vector<double> a(window.size());
    std::vector<double> b(window.size());
    plain->read(window, a);
    cached->read(window, b);
    ASSERT_TRUE(agree(a, b)) << "window " << window.column0 << "," << window.row0 << " "
                             << window.width << " x " << window.height;
  }
  ASSERT_TRUE(agree(read_all(*plain), read_all(*cached)));
  const std::int64_t across = (info.width + info.blocks.width - 1) / info.blocks.width;
  const std::int64_t down = (info.height + info.blocks.height - 1) / info.blocks.height;
  EXPECT_EQ(cache->reads().blocks, across * down);
  EXPECT_GE(cache->reads().decoded_blocks, cache->reads().blocks);
  if (bound_bytes > (64 << 20)) {
    EXPECT_EQ(cache->reads().decoded_blocks, cache->reads().blocks);
  }
}

TEST(RasterReader, BothWaysGiveTheSameHeightsForEveryTypeAndLayout) {
  const TemporaryFolder folder;
  std::uint64_t seed = 0;
  for (const std::string type :
       {"Byte", "UInt16", "Int16", "UInt32", "Int32", "UInt64", "Int64", "Float32", "Float64"}) {
    for (const Layout& layout : layouts()) {
      for (const bool has_mask : {false, true}) {
        if (has_mask && layout.more_bands > 0) continue;
        SCOPED_TRACE(type + ", " + layout.name + (has_mask ? ", masked" : "") + ", seed " +
                     std::to_string(++seed));
        const std::string path = file_in(folder, std::to_string(seed) + ".tif");
        write_raster(path, fixture_of(type, layout, has_mask, seed));
        compare(path, seed, 1LL << 30U);
        compare(path, seed, 0);
        std::filesystem::remove(path);
        if (::testing::Test::HasFailure()) return;
      }
    }
  }
}

TEST(RasterReader, BothWaysGiveTheSameHeightsInEveryFormat) {
  const TemporaryFolder folder;
  const std::string tif = file_in(folder, "a.tif");
  write_raster(tif, fixture_of("Int16", layouts()[4], false, 1));
  for (const std::string driver : {"VRT", "netCDF", "HFA", "AAIGrid", "EHdr"}) {
    SCOPED_TRACE(driver);
    const std::string path = file_in(folder, driver + (driver == "AAIGrid"  ? ".asc"
                                                       : driver == "netCDF" ? ".nc"
                                                                            : ""));
    copy_raster(tif, path, driver);
    compare(path, 1, 1LL << 30U);
    compare(path, 2, 100'000);
  }
}

TEST(RasterReader, SmallBlocksAreCachedSeveralAtATime) {
  const TemporaryFolder folder;
  const auto info_of = [&folder](const Layout& layout) {
    const std::string path = file_in(folder, "a.tif");
    write_raster(path, fixture_of("Int16", layout, false, 1));
    return RasterSource::open(path)->info();
  };
  const RasterInfo rows = info_of(layouts()[1]);
  EXPECT_EQ(rows.blocks.height, 1);
  EXPECT_EQ(rows.blocks.cached_width, 307);
  EXPECT_GT(rows.blocks.cached_height, 100);
  const RasterInfo tiles = info_of(layouts()[4]);
  EXPECT_EQ(tiles.blocks.cached_width, 128);
  EXPECT_EQ(tiles.blocks.cached_bytes, 128 * 128 * 2);
  const RasterInfo small = info_of(layouts()[5]);
  EXPECT_EQ(small.blocks.cached_width % small.blocks.width, 0);
  EXPECT_EQ(small.blocks.cached_height % small.blocks.height, 0);
  EXPECT_GE(small.blocks.cached_width * small.blocks.cached_height, 16'384);
}

TEST(RasterReader, HandlesOnOneFileShareBlocksAndFilesDoNot) {
  const TemporaryFolder folder;
  const auto cache = std::make_shared<SourceBlockCache>(1LL << 30U);
  for (std::uint32_t number = 0; number < 2; ++number) {
    const std::string path = file_in(folder, std::to_string(number) + ".tif");
    write_raster(path, fixture_of("Int16", layouts()[4], false, number));
    for (int handle = 0; handle < 3; ++handle) {
      const auto source = RasterSource::open(path, {.cache = cache, .number = number});
      EXPECT_TRUE(agree(read_all(*source), read_all(*RasterSource::open(path))));
    }
  }
  EXPECT_EQ(cache->reads().decoded_blocks, 2 * 3 * 3);
}

TEST(RasterReader, ATruncatedBlockIsRefusedOnEveryThread) {
  const TemporaryFolder folder;
  for (const Layout& layout : {layouts()[0], layouts()[1], layouts()[4], layouts()[5]}) {
    SCOPED_TRACE(layout.name);
    const std::string path = file_in(folder, "cut.tif");
    write_raster(path, fixture_of("Int16", layout, false, 1));
    std::filesystem::resize_file(path, std::filesystem::file_size(path) * 2 / 3);
    const auto cache = std::make_shared<SourceBlockCache>(1LL << 30U);
    std::atomic<int> refused = 0;
    std::vector<std::thread> threads;
    for (int t = 0; t < 8; ++t) {
      threads.emplace_back([&] {
        try {
          read_all(*open_cached(path, cache));
        } catch (const IoError& error) {
          EXPECT_THAT(error.what(), HasSubstr(path));
          EXPECT_THAT(error.what(), HasSubstr("truncated"));
          ++refused;
        }
      });
    }
    for (std::thread& thread : threads) thread.join();
    EXPECT_EQ(refused, 8);
  }
}

}  // namespace
}  // namespace qmpipe::testing::reader_test
