// Which numbers of a file are its heights: bands, pictures, the grids of a container.
#include "formats/heights/band.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>
#include <regex>

#include "formats/bytes/errors.h"
#include "formats/heights/encoded.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::band_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

std::string refusal_of_heights(const std::string& path, const HeightOptions& options = {}) {
  try {
    RasterSource::open(path, {.heights = options});
  } catch (const IoError& error) {
    return error.what();
  }
  ADD_FAILURE() << path << " was opened";
  return "";
}

HeightOptions with_encoding(HeightEncoding encoding) {
  HeightOptions options;
  options.encoding = encoding;
  return options;
}

HeightOptions with_band(std::int32_t band) {
  HeightOptions options;
  options.band = band;
  return options;
}

// A height as three colours, to the encoding's step.
std::array<int, 3> colours_of(double height_m, HeightEncoding encoding) {
  const double number =
      encoding == HeightEncoding::kTerrainRgb ? (height_m + 10000) * 10 : (height_m + 32768) * 256;
  const auto whole = static_cast<int>(std::lround(number));
  return {whole >> 16, (whole >> 8) & 255, whole & 255};
}

RasterFixture picture_of(const std::function<double(int, int)>& height_m, HeightEncoding encoding) {
  RasterFixture fixture{.width = 75, .height = 61, .type = "Byte"};
  fixture.value = [=](int c, int r) {
    return double{1.0} * colours_of(height_m(c, r), encoding)[0];
  };
  fixture.more_bands = 2;
  fixture.band_value = [=](int band, int c, int r) {
    if (band == 4) return (c + r) % 5 == 0 ? 0.0 : 255.0;
    return double{1.0} *
           colours_of(height_m(c, r), encoding).at(static_cast<std::size_t>(band - 1));
  };
  return fixture;
}

double terrain(int c, int r) { return 900 + 700 * std::sin(c * 0.09) * std::cos(r * 0.12) + c; }

TEST(Pictures, AreRefusedWithTheEncodingThatTheyLookLike) {
  const TemporaryFolder folder;
  for (const HeightEncoding encoding : {HeightEncoding::kTerrainRgb, HeightEncoding::kTerrarium}) {
    const std::string path = file_in(folder, name_of(encoding) + ".tif");
    write_raster(path, picture_of(terrain, encoding));
    const std::string refusal = refusal_of_heights(path);
    EXPECT_THAT(refusal,
                AllOf(HasSubstr("picture"), HasSubstr("--band 1"),
                      HasSubstr("--encoding " + name_of(encoding) + " (which they look like)")));
    // Both ways out work.
    EXPECT_NEAR(read_all(*RasterSource::open(path, {.heights = with_encoding(encoding)}))[100],
                terrain(25, 1), 0.06);
    EXPECT_EQ(read_all(*RasterSource::open(path, {.heights = with_band(1)}))[100],
              colours_of(terrain(25, 1), encoding)[0]);
  }
  RasterFixture photograph{.width = 40, .height = 40, .type = "Byte", .more_bands = 2};
  photograph.value = [](int c, int r) { return (c * 37 + r * 11) % 256; };
  photograph.band_value = [](int b, int c, int r) { return (c * 37 * b + r * 11) % 256; };
  write_raster(file_in(folder, "photo.tif"), photograph);
  EXPECT_THAT(refusal_of_heights(file_in(folder, "photo.tif")),
              AllOf(HasSubstr("picture"), Not(HasSubstr("look like"))));
  photograph.type = "UInt16";
  photograph.creation_options = {"PHOTOMETRIC=RGB"};
  write_raster(file_in(folder, "photo16.tif"), photograph);
  EXPECT_THAT(refusal_of_heights(file_in(folder, "photo16.tif")), HasSubstr("picture"));
  RasterFixture palette{.type = "Byte", .has_palette = true};
  write_raster(file_in(folder, "palette.tif"), palette);
  EXPECT_THAT(refusal_of_heights(file_in(folder, "palette.tif")), HasSubstr("table of colours"));
  EXPECT_EQ(
      read_all(*RasterSource::open(file_in(folder, "palette.tif"), {.heights = with_band(1)}))[3],
      3);
}

TEST(Pictures, AreDecodedToTheStepOfTheirEncodingInEveryLayout) {
  const TemporaryFolder folder;
  int number = 0;
  for (std::uint32_t seed = 0; seed < 6; ++seed) {
    for (const HeightEncoding encoding :
         {HeightEncoding::kTerrainRgb, HeightEncoding::kTerrarium}) {
      SCOPED_TRACE(name_of(encoding) + ", seed " + std::to_string(seed));
      std::mt19937 random(seed);
      const double low = -static_cast<double>(random() % 9000);
      const double range = static_cast<double>(random() % 8000) + 1;
      std::vector<double> heights_m(75 * 61);
      for (double& height_m : heights_m) {
        height_m = low + range * static_cast<double>(random() % 1000) / 999;
      }
      RasterFixture fixture = picture_of(
          [&](int c, int r) { return heights_m[static_cast<std::size_t>(r * 75 + c)]; }, encoding);
      if (seed % 2 == 1) fixture.creation_options = {"TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=32"};
      if (seed % 3 == 1) fixture.creation_options.push_back("INTERLEAVE=BAND");
      const bool has_alpha = seed % 3 == 2;
      if (has_alpha) fixture.more_bands = 3;
      const std::string path = file_in(folder, std::to_string(++number) + ".tif");
      write_raster(path, fixture);
      const OpenOptions plain{.heights = with_encoding(encoding)};
      OpenOptions cached = plain;
      cached.cache = std::make_shared<SourceBlockCache>(1 << 20);
      const auto source = RasterSource::open(path, plain);
      EXPECT_EQ(source->info().band.type_name, "Float32");
      const std::vector<double> read = read_all(*source);
      const std::vector<double> again = read_all(*RasterSource::open(path, cached));
      const double step = encoding == HeightEncoding::kTerrainRgb ? 0.051 : 0.002;
      for (std::size_t k = 0; k < read.size(); ++k) {
        const bool is_void = has_alpha && (k % 75 + k / 75) % 5 == 0;
        ASSERT_EQ(std::isnan(read[k]), is_void) << k;
        if (!is_void) {
          ASSERT_NEAR(read[k], heights_m[k], step) << k;
        }
        ASSERT_TRUE(read[k] == again[k] || is_void) << k;
      }
    }
  }
}

TEST(Pictures, TheDeclaredColourIsAVoidAndOneBandOfItIsNot) {
  const TemporaryFolder folder;
  RasterFixture fixture =
      picture_of([](int c, int) { return c == 0   ? -10000.0
                                         : c == 1 ? -3446.4
                                                  : 200.0; },
                 HeightEncoding::kTerrainRgb);
  fixture.void_value = 0;
  write_raster(file_in(folder, "a.tif"), fixture);
  const auto heights = read_all(*RasterSource::open(
      file_in(folder, "a.tif"), {.heights = with_encoding(HeightEncoding::kTerrainRgb)}));
  EXPECT_TRUE(std::isnan(heights[0]));
  EXPECT_NEAR(heights[1], -3446.4, 0.06);
  EXPECT_NEAR(heights[2], 200, 0.06);
}

TEST(Pictures, CompressedWithLossAreRefused) {
  const TemporaryFolder folder;
  RasterFixture fixture = picture_of(terrain, HeightEncoding::kTerrainRgb);
  fixture.creation_options = {"COMPRESS=JPEG"};
  write_raster(file_in(folder, "a.tif"), fixture);
  EXPECT_THAT(
      refusal_of_heights(file_in(folder, "a.tif"), with_encoding(HeightEncoding::kTerrainRgb)),
      HasSubstr("with loss"));
}

TEST(HeightBand, AnEncodingIsForPicturesAlone) {
  const TemporaryFolder folder;
  write_raster(file_in(folder, "a.tif"), {});
  EXPECT_EQ(
      read_all(*RasterSource::open(file_in(folder, "a.tif"),
                                   {.heights = with_encoding(HeightEncoding::kTerrarium)}))[5],
      11);
}

TEST(HeightBand, IsTheFirstUnlessANumberIsGiven) {
  const TemporaryFolder folder;
  const std::string path = file_in(folder, "a.tif");
  RasterFixture fixture{.more_bands = 2};
  fixture.band_value = [](int band, int c, int r) { return 1000.0 * band + 10 * r + c; };
  write_raster(path, fixture);
  const auto first = RasterSource::open(path);
  EXPECT_EQ(read_all(*first)[5], 11);
  EXPECT_THAT(first->info().assumptions,
              Contains(AllOf(HasSubstr("3 bands"), HasSubstr("--band 2"))));
  for (const int band : {1, 2, 3}) {
    const auto source = RasterSource::open(path, {.heights = with_band(band)});
    EXPECT_EQ(read_all(*source)[5], band == 1 ? 11 : 1000 * band + 11);
    EXPECT_THAT(source->info().assumptions, IsEmpty());
  }
  EXPECT_THAT(refusal_of_heights(path, with_band(4)), HasSubstr("it has 3 bands"));
}

struct Grid {
  std::string name;
  std::map<std::string, std::string> attributes;
};

// A NetCDF file with these variables, whose values are their number in the list.
void write_grids(const TemporaryFolder& folder, const std::string& name,
                 const std::vector<Grid>& grids) {
  RasterFixture fixture{.more_bands = static_cast<int>(grids.size()) - 1};
  fixture.value = [](int, int) { return 1; };
  fixture.band_value = [](int band, int, int) { return band; };
  for (std::size_t k = 0; k < grids.size(); ++k) {
    auto metadata = grids[k].attributes;
    metadata["NETCDF_VARNAME"] = grids[k].name;
    if (k == 0) {
      fixture.band_metadata = metadata;
    } else {
      fixture.more_metadata.push_back(metadata);
    }
  }
  write_raster(file_in(folder, "grids.tif"), fixture);
  copy_raster(file_in(folder, "grids.tif"), file_in(folder, name), "netCDF");
}

TEST(Subdatasets, TheOneThatIsAHeightIsTaken) {
  const TemporaryFolder folder;
  struct Case {
    std::vector<Grid> grids;
    int taken;
    std::string reason;
  };
  const std::vector<Case> cases = {
      {{{"tid", {}}, {"elevation", {}}}, 2, "its name"},
      {{{"b", {}}, {"a", {}}}, 1, ""},
      {{{"sst", {{"units", "K"}}}, {"h", {{"units", "m"}}}}, 2, "unit"},
      {{{"elevation_std", {{"units", "m"}}}, {"foo", {}}}, 2, ""},
      {{{"depth_uncertainty", {{"units", "m"}}}, {"depth", {{"units", "m"}}}}, 2, "name"},
      {{{"z", {{"units", "m"}}},
        {"x1", {{"standard_name", "height_above_mean_sea_level"}, {"units", "m"}}}},
       2,
       "standard_name"},
      {{{"wind", {{"standard_name", "wind_speed"}, {"units", "m s-1"}}},
        {"orog", {{"standard_name", "surface_altitude"}, {"units", "m"}}},
        {"lsm", {{"standard_name", "land_binary_mask"}}}},
       2,
       "surface_altitude"},
      {{{"a", {{"standard_name", "sea_floor_depth_below_geoid"}}}, {"b", {{"units", "m"}}}},
       1,
       "sea_floor_depth"}};
  int number = 0;
  for (const Case& one : cases) {
    SCOPED_TRACE(++number);
    const std::string name = std::to_string(number) + ".nc";
    write_grids(folder, name, one.grids);
    const auto source = RasterSource::open(file_in(folder, name));
    EXPECT_EQ(std::abs(read_all(*source)[0]), one.taken);
    ASSERT_THAT(source->info().assumptions, Contains(HasSubstr("to take another")));
    const std::string note = source->info().assumptions.front();
    EXPECT_THAT(note, HasSubstr(one.reason));
    // What the note names can be given.
    std::smatch found;
    ASSERT_TRUE(std::regex_search(note, found, std::regex("such as '(.*)'$"))) << note;
    const auto other = RasterSource::open(found[1].str());
    EXPECT_NE(std::abs(read_all(*other)[0]), one.taken);
  }
}

TEST(OpenOptions, ReachTheDriverAndUnknownOnesAreTold) {
  const TemporaryFolder folder;
  const auto data = real_data("faults/test_vr.bag");
  if (!data) GTEST_SKIP() << "no real data (set QMPIPE_DATA)";
  const auto coarse = RasterSource::open(*data, {.placing = Placing::kPlane});
  EXPECT_THAT(coarse->info().assumptions, Contains(HasSubstr("--oo MODE=RESAMPLED_GRID")));
  HeightOptions options;
  options.open_options = {"MODE=RESAMPLED_GRID"};
  const auto fine = RasterSource::open(*data, {.heights = options, .placing = Placing::kPlane});
  EXPECT_GT(fine->info().width, 4 * coarse->info().width);
  EXPECT_THAT(fine->info().assumptions, Not(Contains(HasSubstr("MODE"))));
  options.open_options = {"MOOD=GOOD"};
  const auto odd = RasterSource::open(*data, {.heights = options, .placing = Placing::kPlane});
  EXPECT_THAT(odd->info().assumptions, Contains(HasSubstr("no open option MOOD")));
}

}  // namespace
}  // namespace qmpipe::testing::band_test
