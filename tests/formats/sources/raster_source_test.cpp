#include "formats/sources/raster_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "formats/bytes/errors.h"
#include "formats/raster/height_unit.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::raster_source_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr double kInf = std::numeric_limits<double>::infinity();

// The message of the IoError that opening ends with.
std::string refusal_of(const std::string& path, const OpenOptions& options = {}) {
  try {
    RasterSource::open(path, options);
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr(path));
    return error.what();
  }
  ADD_FAILURE() << path << " was opened";
  return "";
}

RasterFixture one_row(std::vector<double> values, const std::string& type) {
  RasterFixture fixture{.width = static_cast<int>(values.size()), .height = 1, .type = type};
  fixture.value = [values](int c, int) { return values[static_cast<std::size_t>(c)]; };
  return fixture;
}

TEST(RasterSource, ReadsHeightsRowByRowFromTheTop) {
  const TemporaryFolder folder;
  const auto source = open_fixture(file_in(folder, "a.tif"), {});
  EXPECT_THAT(read_all(*source),
              ::testing::ElementsAre(0, 1, 2, 3, 10, 11, 12, 13, 20, 21, 22, 23));
  std::vector<double> window(2);
  source->read({.column0 = 2, .row0 = 1, .width = 2, .height = 1}, window);
  EXPECT_THAT(window, ::testing::ElementsAre(12, 13));
  EXPECT_EQ(source->info().driver, "GTiff");
  EXPECT_EQ(source->info().band.unit, "m");
  EXPECT_THAT(source->info().assumptions, IsEmpty());
}

TEST(RasterSource, EveryKindOfVoidIsNaN) {
  const TemporaryFolder folder;
  struct Case {
    std::string type;
    std::optional<double> void_value;
    double raw;
    bool is_void;
  };
  const std::vector<Case> cases = {
      {"Int16", -32768, -32768, true},
      {"Int16", -32678, -32678, true},
      {"Int16", -32678, -32768, false},
      {"UInt16", 65535, 65535, true},
      {"Int32", -9999, -9999, true},
      {"Float32", -999999, -999999, true},
      {"Float32", -9999.9, -9999.9, true},  // not a float
      {"Float32", -3.4028234663852886e38, -3.4028234663852886e38, true},
      {"Float32", -3.40282e+38, -3.4028234663852886e38, true},  // as text files round it
      {"Float32", kNaN, kNaN, true},
      {"Float32", std::nullopt, kNaN, true},
      {"Float32", std::nullopt, kInf, true},
      {"Float32", std::nullopt, -kInf, true},
      {"Float32", std::nullopt, 1.1e30, true},
      {"Float32", std::nullopt, -1.1e30, true},
      {"Float32", std::nullopt, -32768, false},
      {"Float64", 1e6, 1e6, true},
      {"Float64", 0, 0, true},
      {"Float64", kNaN, 0, false},
  };
  int number = 0;
  for (const Case& one : cases) {
    SCOPED_TRACE(one.type + " " + std::to_string(one.raw));
    RasterFixture fixture = one_row({one.raw, 7}, one.type);
    fixture.void_value = one.void_value;
    const auto source = open_fixture(file_in(folder, std::to_string(++number) + ".tif"), fixture);
    const std::vector<double> heights = read_all(*source);
    EXPECT_EQ(std::isnan(heights[0]), one.is_void);
    EXPECT_EQ(heights[1], 7);
  }
}

TEST(RasterSource, MaskBandMakesVoids) {
  const TemporaryFolder folder;
  RasterFixture fixture = one_row({1, 2, 3}, "Int16");
  fixture.mask = {255, 0, 255};
  const std::vector<double> heights = read_all(*open_fixture(file_in(folder, "a.tif"), fixture));
  EXPECT_EQ(heights[0], 1);
  EXPECT_TRUE(std::isnan(heights[1]));
  EXPECT_EQ(heights[2], 3);
}

TEST(RasterSource, ScaleOffsetAndUnitApplyAfterTheVoidValue) {
  const TemporaryFolder folder;
  RasterFixture fixture = one_row({100, -32768, 0}, "Int16");
  fixture.void_value = -32768;
  fixture.scale = 0.5;
  fixture.offset = 10;
  fixture.unit = "ft";
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  const std::vector<double> heights = read_all(*source);
  EXPECT_DOUBLE_EQ(heights[0], 60 * 0.3048);
  EXPECT_TRUE(std::isnan(heights[1]));
  EXPECT_DOUBLE_EQ(heights[2], 10 * 0.3048);
  EXPECT_EQ(source->info().band.metres_per_unit, 0.3048);
}

TEST(RasterSource, UnknownUnitIsTakenAsMetresAndSaid) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.unit = "smoot";
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_EQ(source->info().band.metres_per_unit, 1);
  EXPECT_THAT(source->info().assumptions, ::testing::Contains(HasSubstr("smoot")));
}

TEST(HeightUnit, NamesOfOneUnitAgree) {
  for (const char* name : {"US survey foot", "us-ft", "ftUS", "US_survey_foot", "Foot (US)"}) {
    EXPECT_EQ(metres_per_unit(name), 1200.0 / 3937.0) << name;
  }
  for (const char* name : {"ft", "foot", "Feet"}) EXPECT_EQ(metres_per_unit(name), 0.3048) << name;
  for (const char* name : {"", "m", "metre", "Meters"}) EXPECT_EQ(metres_per_unit(name), 1) << name;
  EXPECT_EQ(metres_per_unit("km"), 1000);
  EXPECT_EQ(metres_per_unit("fathoms"), 1.8288);
  for (const char* name : {"m/s", "m2", "degrees", "dBZ"}) EXPECT_FALSE(metres_per_unit(name));
}

TEST(RasterSource, PixelZeroStartsAtTheOuterCorner) {
  const TemporaryFolder folder;
  const auto source = open_fixture(file_in(folder, "a.tif"), {});
  const auto corner = source->pixel_at(10, 50);
  ASSERT_TRUE(corner);
  EXPECT_EQ(corner->column, 0);
  EXPECT_EQ(corner->row, 0);
  const auto centre = source->pixel_at(11.5, 49.5);
  ASSERT_TRUE(centre);
  EXPECT_EQ(centre->column, 1.5);
  EXPECT_EQ(centre->row, 0.5);
  EXPECT_EQ(source->info().bounds_deg, (RectangleDeg{10, 47, 14, 50}));
  EXPECT_EQ(source->info().pixel_deg, 1);
  EXPECT_TRUE(source->info().is_separable);
}

TEST(RasterSource, PointFilesAreShiftedByHalfAPixel) {
  const TemporaryFolder folder;
  // GDAL's geotransform is the same for both kinds; the file's tie point differs.
  RasterFixture fixture;
  fixture.pixel_is = PixelIs::kPoint;
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_EQ(source->pixel_at(10.5, 49.5)->column, 0.5);
  const auto data = real_data("N43E007.hgt.zip");
  if (!data) GTEST_SKIP() << "no real data (set QMPIPE_DATA)";
  // SRTM's first post stands on the integer degree.
  const auto srtm = RasterSource::open(*data);
  EXPECT_NEAR(srtm->pixel_at(7, 44)->column, 0.5, 1e-8);
  EXPECT_NEAR(srtm->pixel_at(7, 44)->row, 0.5, 1e-8);
}

TEST(RasterSource, RotatedRastersAreInverted) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.geotransform = {{10, 0.8, 0.6, 50, 0.6, -0.8}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  const auto at = source->pixel_at(10 + 0.8 * 3 + 0.6 * 2, 50 + 0.6 * 3 - 0.8 * 2);
  ASSERT_TRUE(at);
  EXPECT_NEAR(at->column, 3, 1e-12);
  EXPECT_NEAR(at->row, 2, 1e-12);
  EXPECT_FALSE(source->info().is_separable);
  EXPECT_NEAR(source->info().bounds_deg.east_deg, 10 + 0.8 * 4 + 0.6 * 3, 1e-9);
  EXPECT_NEAR(source->info().bounds_deg.north_deg, 50 + 0.6 * 4, 1e-9);
}

TEST(RasterSource, GeotransformsThatCannotBeUsedAreRefused) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.geotransform = {{10, 1, 1, 50, 1, 1}};
  write_raster(file_in(folder, "singular.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "singular.tif")), HasSubstr("inverted"));
  fixture.geotransform.reset();
  write_raster(file_in(folder, "none.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "none.tif")), HasSubstr("-a_ullr"));
}

TEST(RasterSource, WithoutCrsTheRemedyIsNamed) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.crs = "";
  write_raster(file_in(folder, "a.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "a.tif")), HasSubstr("gdal_edit.py -a_srs"));
  const auto source = RasterSource::open(file_in(folder, "a.tif"), {.crs_override = "EPSG:4326"});
  EXPECT_EQ(source->pixel_at(12, 49)->column, 2);
  EXPECT_THROW(RasterSource::open(file_in(folder, "a.tif"), {.crs_override = "EPSG:nonsense"}),
               UsageError);
}

TEST(RasterSource, CrsOffTheGlobeIsRefused) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.crs = "LOCAL_CS[\"site\",UNIT[\"metre\",1]]";
  write_raster(file_in(folder, "a.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "a.tif")), HasSubstr("--source-crs"));
  fixture.crs = "EPSG:4326";
  fixture.geotransform = {{500000, 30, 0, 4000000, 0, -30}};
  write_raster(file_in(folder, "b.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "b.tif")), HasSubstr("no degrees"));
}

TEST(RasterSource, FilesThatAreNoRastersAreRefused) {
  const TemporaryFolder folder;
  EXPECT_THAT(refusal_of(file_in(folder, "missing.tif")), HasSubstr("No such file"));
  for (const char* name : {"text.tif", "broken.zip", "empty.tif"}) {
    std::ofstream file(file_in(folder, name));
    if (std::string(name) != "empty.tif") file << "this is no raster";
    file.close();
    EXPECT_THAT(refusal_of(file_in(folder, name)), Not(IsEmpty()));
  }
  EXPECT_THAT(refusal_of(folder.path().string()), Not(IsEmpty()));
}

TEST(RasterSource, ArchivesWithOneRasterOpen) {
  const TemporaryFolder folder;
  write_raster(file_in(folder, "dem.tif"), {});
  folder.put("readme.txt", "about the DEM");
  const std::string archive = file_in(folder, "dem.zip");
  add_to_zip(archive, file_in(folder, "readme.txt"));
  EXPECT_THAT(refusal_of(archive), HasSubstr("0 rasters"));
  add_to_zip(archive, file_in(folder, "dem.tif"));
  EXPECT_EQ(read_all(*RasterSource::open(archive))[5], 11);
  write_raster(file_in(folder, "other.tif"), {});
  add_to_zip(archive, file_in(folder, "other.tif"));
  EXPECT_THAT(refusal_of(archive), HasSubstr("/vsizip/"));
}

TEST(RasterSource, ComplexRastersAreRefused) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.type = "CFloat32";
  write_raster(file_in(folder, "a.tif"), fixture);
  EXPECT_THAT(refusal_of(file_in(folder, "a.tif")), HasSubstr("complex"));
}

TEST(RasterSource, EveryTruncationIsRefusedOrReadInFull) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 64, .height = 64, .type = "Int16"};
  fixture.creation_options = {"TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16", "COMPRESS=DEFLATE"};
  const std::string whole = file_in(folder, "whole.tif");
  write_raster(whole, fixture);
  const auto size = std::filesystem::file_size(whole);
  int refused = 0;
  for (std::uintmax_t length = 0; length < size; length += 97) {
    SCOPED_TRACE(length);
    const std::string part = file_in(folder, "part.tif");
    std::filesystem::copy_file(whole, part, std::filesystem::copy_options::overwrite_existing);
    std::filesystem::resize_file(part, length);
    try {
      const auto source = RasterSource::open(part);
      EXPECT_EQ(read_all(*source).size(), 64U * 64U);
    } catch (const IoError& error) {
      EXPECT_THAT(error.what(), HasSubstr("part.tif"));
      ++refused;
    }
  }
  EXPECT_GT(refused, 10);
}

TEST(RasterSource, TruncatedBlocksAreNamed) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 256, .height = 256};
  fixture.geotransform = {{10, 0.1, 0, 50, 0, -0.1}};
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  std::filesystem::resize_file(path, std::filesystem::file_size(path) / 2);
  const auto source = RasterSource::open(path);
  std::vector<double> window(16);
  try {
    source->read({.column0 = 8, .row0 = 250, .width = 16, .height = 1}, window);
    FAIL() << "a missing block was read";
  } catch (const IoError& error) {
    EXPECT_THAT(error.what(), HasSubstr("rows 250 to 250"));
    EXPECT_THAT(error.what(), HasSubstr("truncated"));
  }
}

TEST(RasterSource, OnePixelIsARaster) {
  const TemporaryFolder folder;
  const auto source = open_fixture(file_in(folder, "a.tif"), one_row({5}, "Float32"));
  EXPECT_THAT(read_all(*source), ::testing::ElementsAre(5));
  EXPECT_EQ(source->info().pixel_deg, 1);
}

TEST(RasterSource, LongitudesMoveIntoTheRastersRange) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 60, .height = 40};
  fixture.geotransform = {{160, 1, 0, 40, 0, -1}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_EQ(source->pixel_at(170, 0)->column, 10);
  EXPECT_EQ(source->pixel_at(-170, 0)->column, 30);
  EXPECT_EQ(source->pixel_at(180, 0)->column, 20);
  EXPECT_EQ(source->pixel_at(-180, 0)->column, 20);
  EXPECT_EQ(source->info().bounds_deg, (RectangleDeg{160, 0, 220, 40}));
  EXPECT_FALSE(source->info().wraps_columns);
}

TEST(RasterSource, GlobalGridsWrap) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 36, .height = 18};
  fixture.geotransform = {{-5, 10, 0, 90, 0, -10}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_TRUE(source->info().wraps_columns);
  EXPECT_EQ(source->info().bounds_deg, (RectangleDeg{-180, -90, 180, 90}));
  EXPECT_EQ(source->pixel_at(-5, 0)->column, 0);
  EXPECT_EQ(source->pixel_at(355, 0)->column, 0);
  fixture.width = 35;
  EXPECT_FALSE(open_fixture(file_in(folder, "b.tif"), fixture)->info().wraps_columns);
}

TEST(RasterSource, PolarRastersHoldAllLongitudes) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 40, .height = 40};
  fixture.crs = "EPSG:3031";
  fixture.geotransform = {{-2000000, 100000, 0, 2000000, 0, -100000}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  const RectangleDeg bounds = source->info().bounds_deg;
  EXPECT_EQ(bounds.west_deg, -180);
  EXPECT_EQ(bounds.east_deg, 180);
  EXPECT_EQ(bounds.south_deg, -90);
  EXPECT_NEAR(bounds.north_deg, -64.5, 1);
  EXPECT_NEAR(source->pixel_at(123, -90)->column, 20, 1e-6);
}

TEST(RasterSource, VerticalPartOfTheCrsIsNotInTheWay) {
  const TemporaryFolder folder;
  RasterFixture fixture;
  fixture.crs = "EPSG:4326+5773";
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_EQ(source->info().band.reference, HeightReference::kDatum);
  EXPECT_TRUE(source->info().crs.is_geographic);
  EXPECT_EQ(source->pixel_at(12, 49)->column, 2);
  fixture.crs = "EPSG:4979";
  const auto with_height = open_fixture(file_in(folder, "b.tif"), fixture);
  EXPECT_EQ(with_height->info().band.reference, HeightReference::kEllipsoid);
  EXPECT_TRUE(with_height->info().is_separable);
}

TEST(RasterSource, AxesInNorthingEastingOrderAreNotSwapped) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 10, .height = 10};
  fixture.crs = "EPSG:2326";  // Hong Kong: northing first in the register
  fixture.geotransform = {{830000, 100, 0, 820000, 0, -100}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  EXPECT_NEAR(source->info().bounds_deg.west_deg, 114.1, 0.1);
  EXPECT_NEAR(source->info().bounds_deg.north_deg, 22.3, 0.1);
}

TEST(RasterSource, APointsPlaceDoesNotDependOnThePast) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 100, .height = 100};
  // PROJ knows dozens of operations from NAD27, for different parts of the continent.
  fixture.crs = "EPSG:26711";
  fixture.geotransform = {{300000, 1000, 0, 4200000, 0, -1000}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  const auto other = RasterSource::open(file_in(folder, "a.tif"));
  const auto first = source->pixel_at(-118.3, 37.5);
  for (int k = 0; k < 200; ++k) other->pixel_at(-170 + 1.7 * k, -80 + 0.8 * k);
  const auto later = other->pixel_at(-118.3, 37.5);
  ASSERT_TRUE(first && later);
  EXPECT_EQ(first->column, later->column);
  EXPECT_EQ(first->row, later->row);
}

// PROJ's last bits depend on the processor: they must not reach a height, a list of tiles or
// layer.json.
TEST(RasterSource, PlacesInAProjectionHaveNoLastBits) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 100, .height = 100};
  fixture.crs = "EPSG:32631";
  fixture.geotransform = {{440000, 30, 0, 4800000, 0, -30}};
  const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
  for (int k = 0; k < 500; ++k) {
    const auto at = source->pixel_at(2.26 + 1e-5 * k, 43.33 + 1.3e-5 * k);
    ASSERT_TRUE(at);
    ASSERT_EQ(std::floor(at->column * 1024), at->column * 1024);
    ASSERT_EQ(std::floor(at->row * 1024), at->row * 1024);
    const auto beside = source->pixel_at(2.26 + 1e-5 * k + 1e-9, 43.33 + 1.3e-5 * k);
    ASSERT_NEAR(beside->column, at->column, 1.0 / 1024);
  }
}

TEST(RasterSource, EdgesAtWholeDegreesAreToldAsSuch) {
  const TemporaryFolder folder;
  constexpr double kMetresPerDegree = 20037508.342789244 / 180;
  for (int west_deg = -179; west_deg < 170; west_deg += 7) {
    RasterFixture fixture{.width = 9, .height = 5};
    fixture.crs = "EPSG:3857";
    const double pixel_m = kMetresPerDegree;
    fixture.geotransform = {{west_deg * kMetresPerDegree, pixel_m, 0, 0, 0, -pixel_m}};
    const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
    ASSERT_EQ(source->info().bounds_deg.west_deg, west_deg);
    ASSERT_EQ(source->info().bounds_deg.east_deg, west_deg + 9);
    ASSERT_EQ(source->info().bounds_deg.north_deg, 0);
  }
}

}  // namespace
}  // namespace qmpipe::testing::raster_source_test
