// Where a set says that its data are, on rasters with corners and holes of random shapes and places.
#include "pipeline/survey/data_cover.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "tests/support/raster_fixture.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing::data_cover_test {
namespace {

using ::testing::Each;
using ::testing::ElementsAre;

constexpr int kWidth = 260;
constexpr int kHeight = 200;

Survey survey_of(const RasterFixture& fixture, Projection projection = Projection::kGeodetic) {
  const TemporaryFolder folder;
  const SurveyChoice choice = {.inputs = {file_in(folder, "dem.tif")},
                               .scheme = TilingScheme(projection)};
  write_raster(choice.inputs.front(), fixture);
  const std::vector<RasterInfo> sources = describe_inputs(choice);
  Progress progress(ProgressStyle::kSilent, nullptr);
  return run_survey(choice, MemoryDivisions({}, choice, sources).best(), {}, sources, nullptr,
                    progress);
}

// A ground of hills whose data end at a slanted line and around a hole.
struct Ground {
  double west_deg = 0;
  double north_deg = 0;
  double pixel_deg = 0;
  double slant = 0;
  double hole_column = 0;
  double hole_row = 0;
  double hole_radius = 0;

  bool has_data(int column, int row) const {
    return column + slant * row > 30 &&
           std::hypot(column - hole_column, row - hole_row) > hole_radius;
  }
  // Whether all pixels within the distance of a place, in pixels, have data, or none has.
  std::optional<bool> around(double column, double row, double distance) const {
    bool is_any = false;
    bool is_all = true;
    for (int r = static_cast<int>(row - distance); r <= static_cast<int>(row + distance); ++r) {
      for (int c = static_cast<int>(column - distance); c <= static_cast<int>(column + distance);
           ++c) {
        const bool has = c >= 0 && r >= 0 && c < kWidth && r < kHeight && has_data(c, r);
        is_any = is_any || has;
        is_all = is_all && has;
      }
    }
    if (is_any != is_all) return std::nullopt;
    return is_all;
  }
  RasterFixture raster() const {
    RasterFixture fixture;
    fixture.width = kWidth;
    fixture.height = kHeight;
    fixture.geotransform = {{west_deg, pixel_deg, 0, north_deg, 0, -pixel_deg}};
    fixture.void_value = -9999;
    fixture.value = [this](int c, int r) {
      return has_data(c, r) ? 300 + 100 * std::sin(c / 9.0) * std::cos(r / 7.0) : -9999.0;
    };
    return fixture;
  }
};

std::vector<bool> flags_of(const std::vector<std::int32_t>& turns, std::int32_t columns) {
  std::vector<bool> flags;
  for (std::size_t turn = 0; turn < turns.size(); ++turn) {
    flags.insert(flags.end(), static_cast<std::size_t>(turns[turn]), turn % 2 == 1);
  }
  EXPECT_LE(flags.size(), static_cast<std::size_t>(columns));
  flags.resize(static_cast<std::size_t>(columns), false);
  return flags;
}

double mercator(double latitude_deg) {
  return std::asinh(std::tan(latitude_deg * std::numbers::pi / 180));
}

// The latitude of a row of the cover.
double latitude_of(const DataCover& cover, Projection projection, std::size_t row) {
  const double share = static_cast<double>(row) / static_cast<double>(cover.rows.size() - 1);
  const auto [south, north] = std::pair(cover.posts_deg.south_deg, cover.posts_deg.north_deg);
  if (projection == Projection::kGeodetic) return south + (north - south) * share;
  const double y = mercator(south) + (mercator(north) - mercator(south)) * share;
  return std::atan(std::sinh(y)) * 180 / std::numbers::pi;
}

void expect_cover(const Ground& ground, Projection projection, const DataCover& cover) {
  ASSERT_GT(cover.columns, 20);
  ASSERT_GT(cover.rows.size(), 20U);
  const double spacing_deg =
      (cover.posts_deg.east_deg - cover.posts_deg.west_deg) / (cover.columns - 1);
  const double distance = 1 + 2.5 * spacing_deg / ground.pixel_deg;
  int with_data = 0;
  int without = 0;
  for (std::size_t row = 0; row < cover.rows.size(); ++row) {
    const std::vector<bool> flags = flags_of(cover.rows[row], cover.columns);
    const double latitude_deg = latitude_of(cover, projection, row);
    for (std::size_t k = 0; k < flags.size(); ++k) {
      const double longitude_deg = cover.posts_deg.west_deg + spacing_deg * static_cast<double>(k);
      const double column =
          std::remainder(longitude_deg - ground.west_deg - ground.pixel_deg * kWidth / 2, 360) /
              ground.pixel_deg +
          kWidth / 2.0;
      const double pixel_row = (ground.north_deg - latitude_deg) / ground.pixel_deg;
      const std::optional<bool> expected = ground.around(column, pixel_row, distance);
      if (!expected) continue;
      EXPECT_EQ(flags[k], *expected) << "at " << longitude_deg << ", " << latitude_deg;
      ++(*expected ? with_data : without);
    }
  }
  EXPECT_GT(with_data, 300);
  EXPECT_GT(without, 20);
}

TEST(DataCover, TellsDataFromHolesAndCornersAnywhere) {
  const std::uint32_t seed = 20261129;
  std::mt19937 random(seed);
  const auto draw = [&random](double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  };
  for (int round = 0; round < 12; ++round) {
    SCOPED_TRACE(::testing::Message() << "seed " << seed << ", round " << round);
    Ground ground;
    ground.pixel_deg = draw(0.0002, 0.02);
    ground.west_deg =
        round % 3 == 0 ? 180 - draw(0.2, 0.8) * kWidth * ground.pixel_deg : draw(-180, 170);
    ground.north_deg = draw(-60, 70);
    ground.slant = draw(-0.3, 0.6);
    ground.hole_column = draw(90, 200);
    ground.hole_row = draw(60, 140);
    ground.hole_radius = draw(25, 50);
    const Projection projection = round % 2 == 0 ? Projection::kGeodetic : Projection::kMercator;
    const std::optional<DataCover> cover = data_cover(survey_of(ground.raster(), projection));
    ASSERT_TRUE(cover);
    expect_cover(ground, projection, *cover);
  }
}

TEST(DataCover, IsAFullBoxWhereTheDataFillIt) {
  RasterFixture fixture;
  fixture.width = 300;
  fixture.height = 200;
  fixture.geotransform = {{177, 0.02, 0, 10, 0, -0.02}};
  const std::optional<DataCover> cover = data_cover(survey_of(fixture));
  ASSERT_TRUE(cover);
  EXPECT_THAT(cover->rows, Each(ElementsAre(0, cover->columns)));
  EXPECT_NEAR(cover->posts_deg.west_deg, 177, 0.1);
  EXPECT_NEAR(cover->posts_deg.east_deg, 183, 0.1);
  EXPECT_NEAR(cover->posts_deg.south_deg, 6, 0.1);
  EXPECT_NEAR(cover->posts_deg.north_deg, 10, 0.1);
}

// Its corners' bounds reach farther from the pole than any data.
TEST(DataCover, IsNoWiderThanTheDataOfAPolarRaster) {
  RasterFixture fixture;
  fixture.crs = "EPSG:3031";
  fixture.width = 400;
  fixture.height = 400;
  fixture.geotransform = {{-2e6, 1e4, 0, 2e6, 0, -1e4}};
  fixture.void_value = -9999;
  fixture.value = [](int c, int r) {
    return std::hypot(c - 199.5, r - 199.5) < 180 ? 50.0 : -9999.0;
  };
  const Survey survey = survey_of(fixture);
  const std::optional<DataCover> cover = data_cover(survey);
  ASSERT_TRUE(cover);
  EXPECT_GT(survey.sources.front().bounds_deg.north_deg, -65);
  EXPECT_LT(cover->posts_deg.north_deg, -72);
  EXPECT_GT(cover->posts_deg.north_deg, -74.5);
}

TEST(DataCover, IsOfTheWholeGlobeWhereTheDataGoRoundIt) {
  RasterFixture fixture;
  fixture.width = 720;
  fixture.height = 300;
  fixture.geotransform = {{-180, 0.5, 0, 75, 0, -0.5}};
  fixture.void_value = -9999;
  fixture.value = [](int c, int r) { return c > 200 && c < 300 && r > 100 ? -9999.0 : 50.0; };
  const std::optional<DataCover> cover = data_cover(survey_of(fixture));
  ASSERT_TRUE(cover);
  EXPECT_EQ(cover->columns, 512);
  EXPECT_EQ(cover->posts_deg.west_deg, -180);
  const std::vector<std::int32_t>& south = cover->rows[20];
  ASSERT_THAT(south, ElementsAre(0, ::testing::_, ::testing::_, ::testing::_));
  EXPECT_NEAR(south[1], 200 * 512 / 720.0, 2);
  EXPECT_NEAR(south[2], 100 * 512 / 720.0, 3);
  EXPECT_EQ(south[1] + south[2] + south[3], 512);
}

TEST(DataCover, ReachesThePolesThatTheDataReach) {
  RasterFixture fixture;
  fixture.width = 720;
  fixture.height = 340;  // from the south pole up to 80 degrees
  fixture.geotransform = {{-180, 0.5, 0, 80, 0, -0.5}};
  fixture.void_value = -9999;
  fixture.value = [](int c, int r) { return c > 200 && r > 200 && r < 300 ? -9999.0 : 50.0; };
  const std::optional<DataCover> cover = data_cover(survey_of(fixture));
  ASSERT_TRUE(cover);
  EXPECT_EQ(cover->posts_deg.south_deg, -90);
  EXPECT_THAT(cover->rows.front(), ElementsAre(0, 512));
  EXPECT_LT(cover->posts_deg.north_deg, 82);
}

TEST(DataCover, StandsInTheRecipeAsLinesOfNumbers) {
  const DataCover cover = {
      .posts_deg = {.west_deg = 5, .south_deg = 43, .east_deg = 6.5, .north_deg = 44},
      .columns = 4,
      .rows = {{0, 4}, {1, 2}, {1, 2}, {}}};
  const auto object = nlohmann::json::parse(with_cover(R"({"scheme":"geodetic"})", cover));
  EXPECT_EQ(object.at("scheme"), "geodetic");
  EXPECT_EQ(object.at("data"),
            nlohmann::json::parse(R"({"posts_deg":[5.0,43.0,6.5,44.0],"columns":4,
                                                         "rows":["1: 0 4","2: 1 2","1: "]})"));
}

}  // namespace
}  // namespace qmpipe::testing::data_cover_test
