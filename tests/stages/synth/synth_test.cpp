#include "stages/synth/synth_terrain.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/raster/writer.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::synth_test {
namespace {

std::vector<std::int16_t> row_of(SynthTerrain& terrain, double latitude_deg,
                                 const std::vector<double>& longitudes_deg) {
  std::vector<std::int16_t> heights(longitudes_deg.size());
  terrain.sample_row(latitude_deg, longitudes_deg, heights);
  return heights;
}

std::vector<double> spaced(double west_deg, double step_deg, int count) {
  std::vector<double> longitudes_deg;
  for (int k = 0; k < count; ++k) longitudes_deg.push_back(west_deg + k * step_deg);
  return longitudes_deg;
}

TEST(SynthTerrain, AHeightDoesNotDependOnItsRow) {
  for (const std::uint32_t seed : {1U, 2U, 99U}) {
    SCOPED_TRACE(seed);
    SynthTerrain a({.seed = seed, .pixel_deg = 0.01, .void_share = 0.1});
    SynthTerrain b({.seed = seed, .pixel_deg = 0.01, .void_share = 0.1});
    const std::vector<double> longitudes = spaced(100, 0.01, 500);
    const auto whole = row_of(a, 12.3, longitudes);
    for (std::size_t k = 0; k < longitudes.size(); k += 13) {
      row_of(b, -40, spaced(3, 1, 5));
      EXPECT_EQ(row_of(b, 12.3, {longitudes[k]})[0], whole[k]);
    }
  }
}

TEST(SynthTerrain, TheWorldHasMountainsPlainsAndDeepSea) {
  SynthTerrain terrain({.seed = 1, .pixel_deg = 0.5});
  int land = 0;
  int all = 0;
  std::int16_t lowest = 0;
  std::int16_t highest = 0;
  for (double latitude = -89.75; latitude < 90; latitude += 0.5) {
    for (const std::int16_t height : row_of(terrain, latitude, spaced(-180, 0.5, 720))) {
      land += height >= 0 ? 1 : 0;
      ++all;
      lowest = std::min(lowest, height);
      highest = std::max(highest, height);
    }
  }
  EXPECT_NEAR(static_cast<double>(land) / all, 0.3, 0.15);
  EXPECT_LT(lowest, -4000);
  EXPECT_GT(lowest, -7000);
  EXPECT_GT(highest, 2000);
  EXPECT_LT(highest, 7000);
}

TEST(SynthTerrain, TheWorldIsRound) {
  SynthTerrain terrain({.seed = 5, .pixel_deg = 0.1});
  for (double latitude = -80; latitude <= 80; latitude += 20) {
    const auto heights = row_of(terrain, latitude, {-180, 180, 540});
    EXPECT_EQ(heights[0], heights[1]);
    EXPECT_EQ(heights[0], heights[2]);
  }
  for (const double pole : {-90.0, 90.0}) {
    const auto heights = row_of(terrain, pole, spaced(-180, 7, 50));
    EXPECT_EQ(*std::min_element(heights.begin(), heights.end()),
              *std::max_element(heights.begin(), heights.end()));
  }
}

TEST(SynthTerrain, SeedsGiveDifferentWorlds) {
  SynthTerrain a({.seed = 1});
  SynthTerrain b({.seed = 2});
  const std::vector<double> longitudes = spaced(-180, 1, 360);
  EXPECT_NE(row_of(a, 10, longitudes), row_of(b, 10, longitudes));
}

TEST(SynthTerrain, VoidsTakeTheShareAskedFor) {
  for (const double share : {0.0, 0.02, 0.3, 0.8, 1.0}) {
    SCOPED_TRACE(share);
    SynthTerrain terrain({.seed = 3, .pixel_deg = 0.001, .void_share = share});
    int voids = 0;
    for (int r = 0; r < 600; ++r) {
      const auto heights = row_of(terrain, 30 + 0.001 * r, spaced(20, 0.001, 600));
      voids += static_cast<int>(std::count(heights.begin(), heights.end(), -32768));
    }
    EXPECT_NEAR(voids / 360000.0, share, 0.01 + 0.1 * share);
  }
}

TEST(SynthTerrain, FinerPixelsAddDetailWithoutMovingTheLand) {
  SynthTerrain coarse({.seed = 1, .pixel_deg = 0.02});
  SynthTerrain fine({.seed = 1, .pixel_deg = 0.001});
  const std::vector<double> longitudes = spaced(108, 0.02, 150);
  const auto a = row_of(coarse, 16, longitudes);
  const auto b = row_of(fine, 16, longitudes);
  int differ = 0;
  for (std::size_t k = 0; k < a.size(); ++k) {
    EXPECT_NEAR(a[k], b[k], 700);
    differ += a[k] != b[k] ? 1 : 0;
  }
  EXPECT_GT(differ, 50);
}

RasterWriterOptions small_raster() {
  return {.width = 300, .height = 270, .bounds_deg = {10, 40, 13, 42.7}};
}

void write_blocks(RasterWriter& writer, const RasterWriterOptions& options) {
  for (std::int64_t r = 0; r < options.height; r += options.block_posts) {
    for (std::int64_t c = 0; c < options.width; c += options.block_posts) {
      const PixelWindow window{
          .column0 = c,
          .row0 = r,
          .width = std::min<std::int64_t>(options.block_posts, options.width - c),
          .height = std::min<std::int64_t>(options.block_posts, options.height - r)};
      std::vector<std::int16_t> heights(window.size());
      for (std::size_t k = 0; k < heights.size(); ++k) {
        const auto at = static_cast<std::int64_t>(k);
        heights[k] =
            static_cast<std::int16_t>((r + at / window.width) * 10 + c + at % window.width);
      }
      writer.write_block(window, heights);
    }
  }
}

TEST(RasterWriter, WhatIsWrittenIsRead) {
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "a.tif");
  RasterWriterOptions options = small_raster();
  options.void_value = 10;
  const auto writer = RasterWriter::create(path, options);
  write_blocks(*writer, options);
  writer->close();
  const auto source = RasterSource::open(path);
  EXPECT_EQ(source->info().blocks.width, 256);
  EXPECT_EQ(source->info().bounds_deg, options.bounds_deg);
  const std::vector<double> heights = read_all(*source);
  EXPECT_EQ(heights[0], 0);
  EXPECT_TRUE(std::isnan(heights[10]));
  EXPECT_EQ(heights[269 * 300 + 299], 2690 + 299);
}

TEST(RasterWriter, FoldersThatAreNotThereAreNamed) {
  const TemporaryFolder folder;
  EXPECT_THROW(RasterWriter::create(file_in(folder, "none/a.tif"), small_raster()), IoError);
}

TEST(RasterWriter, AFullDiskIsAnError) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  EXPECT_THROW(
      {
        const auto writer = RasterWriter::create("/dev/full", small_raster());
        write_blocks(*writer, small_raster());
        writer->close();
      },
      IoError);
}

}  // namespace
}  // namespace qmpipe::testing::synth_test
