// What the numbers of a band mean: which way up, in which unit, above what.
#include "formats/heights/rule.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

#include "formats/raster/height_unit.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::rule_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(HeightOptions, ScaleAndOffsetComeAfterWhatTheFileSays) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 3, .height = 1, .type = "Int16"};
  fixture.value = [](int c, int) { return c == 0 ? -32768.0 : 100.0 * c; };
  fixture.void_value = -32768;
  fixture.scale = 0.5;
  fixture.offset = 10;
  fixture.unit = "ft";
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  HeightOptions options;
  options.z_scale = -2;
  options.z_offset_m = 7;
  const auto heights = read_all(*RasterSource::open(path, {.heights = options}));
  EXPECT_TRUE(std::isnan(heights[0]));
  EXPECT_DOUBLE_EQ(heights[1], 60 * 0.3048 * -2 + 7);
  EXPECT_DOUBLE_EQ(heights[2], 110 * 0.3048 * -2 + 7);
}

struct Direction {
  std::string what;
  std::map<std::string, std::string> metadata;
  std::string crs = "EPSG:4326";
  bool is_down = false;
};

std::vector<Direction> directions() {
  return {{"nothing said", {}},
          {"positive up", {{"positive", "up"}}},
          {"positive down", {{"positive", "down"}}, "EPSG:4326", true},
          {"in capitals", {{"positive", "Down"}}, "EPSG:4326", true},
          {"a height", {{"standard_name", "height_above_mean_sea_level"}}},
          {"an altitude", {{"standard_name", "surface_altitude"}}},
          {"a depth", {{"standard_name", "depth"}}, "EPSG:4326", true},
          {"a depth below something", {{"standard_name", "depth_below_geoid"}}, "EPSG:4326", true},
          {"the sea floor",
           {{"standard_name", "sea_floor_depth_below_mean_sea_level"}},
           "EPSG:4326",
           true},
          {"a depth with the other sign",
           {{"standard_name", "sea_floor_depth_below_geoid"}, {"positive", "up"}}},
          {"heights by the CRS", {}, "EPSG:4326+5773"},
          {"depths by the CRS", {}, "EPSG:4326+5715", true},
          {"depths below a tide, in a projection", {}, "EPSG:32631+5866", true},
          {"depths in feet", {}, "EPSG:4326+6359", true},
          {"depths by the CRS, but positive up", {{"positive", "up"}}, "EPSG:4326+5715"},
          {"both say depths", {{"positive", "down"}}, "EPSG:4326+5715", true},
          {"an axis of the ellipsoid", {}, "EPSG:4979"}};
}

TEST(HeightRule, DepthsBecomeHeightsWhateverSaysThatTheyAreDepths) {
  const TemporaryFolder folder;
  for (const Direction& one : directions()) {
    SCOPED_TRACE(one.what);
    RasterFixture fixture{.width = 3, .height = 1, .crs = one.crs};
    fixture.band_metadata = one.metadata;
    fixture.value = [](int c, int) { return 100.0 * c - 50; };
    const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
    const double metres = source->info().band.metres_per_unit * (one.is_down ? -1 : 1);
    EXPECT_THAT(read_all(*source), ::testing::ElementsAre(-50 * metres, 50 * metres, 150 * metres));
    if (one.is_down) {
      EXPECT_THAT(source->info().assumptions, Contains(HasSubstr("--z-scale -1")));
      // The way back that is named works.
      HeightOptions turned;
      turned.z_scale = -1;
      const auto again = RasterSource::open(file_in(folder, "a.tif"), {.heights = turned});
      EXPECT_DOUBLE_EQ(read_all(*again)[2], 150 * source->info().band.metres_per_unit);
    } else {
      EXPECT_THAT(source->info().assumptions, Not(Contains(HasSubstr("depths"))));
    }
  }
}

TEST(HeightRule, ACrsThatTheUserGivesDecidesTheDirectionToo) {
  const TemporaryFolder folder;
  write_raster(file_in(folder, "a.tif"), {});
  const auto depths =
      RasterSource::open(file_in(folder, "a.tif"), {.crs_override = "EPSG:4326+5715"});
  EXPECT_EQ(read_all(*depths)[1], -1);
  EXPECT_EQ(depths->info().band.vertical_name, "MSL depth");
}

TEST(HeightRule, ABagIsPositiveUpWhateverItsCrsSays) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 4, .height = 4, .crs = "EPSG:32631+5866", .more_bands = 1};
  fixture.geotransform = {{500000, 10, 0, 5000000, 0, -10}};
  fixture.value = [](int c, int r) { return -10.0 - c - r; };
  write_raster(file_in(folder, "a.tif"), fixture);
  copy_raster(file_in(folder, "a.tif"), file_in(folder, "a.bag"), "BAG");
  EXPECT_EQ(read_all(*RasterSource::open(file_in(folder, "a.bag")))[1], -11);
}

TEST(HeightRule, WhatHeightsAreAboveIsNamed) {
  const TemporaryFolder folder;
  struct Case {
    std::string crs;
    HeightReference reference;
    std::string name;
  };
  for (const Case& one :
       {Case{"EPSG:4326", HeightReference::kUnknown, ""},
        Case{"EPSG:32631", HeightReference::kUnknown, ""},
        Case{"EPSG:4979", HeightReference::kEllipsoid, ""},
        Case{"EPSG:7415", HeightReference::kDatum, "NAP height"},
        Case{"EPSG:4326+5773", HeightReference::kDatum, "EGM96 height"},
        Case{"EPSG:32631+3855", HeightReference::kDatum, "EGM2008 height"},
        Case{"+proj=longlat +datum=WGS84 +geoidgrids=no_such.gtx +type=crs",
             HeightReference::kDatum, "unknown"},
        Case{"COMPOUNDCRS[\"a\",GEOGCRS[\"WGS 84\",DATUM[\"WGS_1984\",ELLIPSOID[\"WGS "
             "84\",6378137,298.257223563]],CS[ellipsoidal,2],AXIS[\"lat\",north],AXIS[\"lon\","
             "east],ANGLEUNIT[\"degree\",0.0174532925199433]],VERTCRS[\"Ellipsoid height\","
             "VDATUM[\"Ellipsoid\"],CS[vertical,1],AXIS[\"up\",up],LENGTHUNIT[\"metre\",1]]]",
             HeightReference::kEllipsoid, "Ellipsoid height"}}) {
    SCOPED_TRACE(one.crs);
    write_raster(file_in(folder, "a.tif"), {.crs = ""});
    const auto source = RasterSource::open(file_in(folder, "a.tif"),
                                           {.crs_override = one.crs, .placing = Placing::kPlane});
    EXPECT_EQ(source->info().band.reference, one.reference);
    EXPECT_EQ(source->info().band.vertical_name, one.name);
  }
}

TEST(HeightRule, FeetOfTheCrsAreNoFeetOfHeightsAndTheFactorIsTold) {
  const TemporaryFolder folder;
  RasterFixture fixture{.crs = "EPSG:2225"};
  fixture.geotransform = {{6000000, 100, 0, 2000000, 0, -100}};
  const std::string path = file_in(folder, "a.tif");
  const auto source = open_fixture(path, fixture);
  EXPECT_EQ(read_all(*source)[3], 3);
  ASSERT_THAT(source->info().assumptions, Contains(HasSubstr("--z-scale 0.3048006096")));
  // Where the unit is said there is nothing to tell.
  fixture.unit = "us-ft";
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, IsEmpty());
  fixture.unit = "";
  fixture.crs = "EPSG:2225+6360";
  EXPECT_THAT(open_fixture(path, fixture)->info().assumptions, IsEmpty());
  EXPECT_NEAR(read_all(*RasterSource::open(path))[3], 3 * 1200.0 / 3937, 1e-9);
}

TEST(HeightUnit, AFootIsOneInEverySpelling) {
  const double us_foot = 1200.0 / 3937.0;
  for (const char* name : {"US Foot",
                           "US Feet",
                           "us foot",
                           "Feet (US Survey)",
                           "Foot (US survey)",
                           "US survey ft",
                           "ft-us",
                           "ftUS",
                           "FT_US",
                           "foot_us",
                           "Foot_US",
                           "U.S. survey feet",
                           "survey foot",
                           "sft",
                           "US-ft",
                           "usft",
                           "us_survey_foot",
                           "United States survey foot",
                           "feet us survey",
                           "ft (US survey)"}) {
    ASSERT_TRUE(metres_per_unit(name)) << name;
    EXPECT_EQ(*metres_per_unit(name), us_foot) << name;
  }
  for (const char* name : {"foot", "Feet", "FT", "ft.", "international foot",
                           "Foot (International)", "intl. feet", "ift", "feets"}) {
    ASSERT_TRUE(metres_per_unit(name)) << name;
    EXPECT_EQ(*metres_per_unit(name), 0.3048) << name;
  }
  for (const auto& [name, metres] : {std::pair{"Metres", 1.0},
                                     {"METER", 1.0},
                                     {"[m]", 1.0},
                                     {"cm", 0.01},
                                     {"Centimeters", 0.01},
                                     {"mm", 0.001},
                                     {"decimetres", 0.1},
                                     {"km", 1000.0},
                                     {"Fathoms", 1.8288},
                                     {"yds", 0.9144}}) {
    ASSERT_TRUE(metres_per_unit(name)) << name;
    EXPECT_EQ(*metres_per_unit(name), metres) << name;
  }
  for (const char* name : {"m2", "m/s", "K", "us", "survey", "international", "british foot",
                           "football", "status", "sms", "degrees", "1"}) {
    EXPECT_FALSE(metres_per_unit(name)) << name;
  }
}

}  // namespace
}  // namespace qmpipe::testing::rule_test
