// read_point_cloud() on LAS files: the grid, units and CRS, what is left out, a real survey.
#include "formats/points/point_cloud.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "formats/bytes/errors.h"
#include "tests/support/las_fixture.h"
#include "tests/support/raster_fixture.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::point_cloud_test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::las_bytes;
using testing::LasFixture;
using testing::LasFixturePoint;
using testing::TemporaryFolder;

PointCloud read_las(const LasFixture& fixture, const PointReadOptions& options = {}) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> bytes = las_bytes(fixture);
  folder.put("points.las", std::string(bytes.begin(), bytes.end()));
  return read_point_cloud(folder.path() / "points.las", options);
}

template <class Read>
std::string refusal_of(const Read& read) {
  try {
    read();
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

LasFixture corners() {
  LasFixture fixture;
  fixture.points = {{{100, 200, 5}}, {{300, 200, -6}}, {{100, 500, 7}}, {{300, 500, 8}}};
  return fixture;
}

TEST(PointCloud, LasIntegersStayAsTheyAreButForTheShiftToZero) {
  LasFixture fixture = corners();
  fixture.offset = {500000, 4000000, 1000};
  const PointCloud cloud = read_las(fixture);
  EXPECT_THAT(cloud.points, ElementsAre(DetailPoint{0, 0, 5}, DetailPoint{0, 300, 7},
                                        DetailPoint{200, 0, -6}, DetailPoint{200, 300, 8}));
  EXPECT_THAT(cloud.frame.step_m, ElementsAre(0.01, 0.01, 0.01));
  EXPECT_THAT(cloud.frame.place(cloud.points[3]), ElementsAre(500003, 4000005, 1000.08));
  EXPECT_EQ(cloud.counts.in_file, 4U);
  EXPECT_EQ(left_out(cloud.counts), "");
  EXPECT_THAT(cloud.assumptions, ElementsAre(HasSubstr("names no CRS")));
}

TEST(PointCloud, DifferentStepsInXAndYBecomeTheFinerOne) {
  LasFixture fixture = corners();
  fixture.scale = {0.02, 0.01, 0.001};
  const PointCloud cloud = read_las(fixture);
  EXPECT_EQ(cloud.frame.step_m[0], 0.01);
  EXPECT_EQ(cloud.frame.step_m[1], 0.01);
  EXPECT_EQ(cloud.points.back(), (DetailPoint{400, 300, 8}));
}

TEST(PointCloud, TheExtremesOfAnIntegerAreRefusedWithTheRemedy) {
  LasFixture fixture = corners();
  fixture.points.push_back({{2000000000, 0, 0}});
  const std::string what = refusal_of([&] { read_las(fixture); });
  EXPECT_THAT(what, HasSubstr("1 of its 5 points"));
  EXPECT_THAT(what, HasSubstr("pdal translate"));
}

TEST(PointCloud, OneStrayInAThousandIsLeftOutAndCounted) {
  LasFixture fixture;
  for (int k = 0; k < 1000; ++k) fixture.points.push_back({{k % 40, k / 40, k}});
  fixture.points.push_back({{-2000000000, -50, 0}});
  const PointCloud cloud = read_las(fixture);
  EXPECT_EQ(cloud.points.size(), 1000U);
  EXPECT_EQ(cloud.counts.off_grid, 1U);
  EXPECT_EQ(cloud.points.front(), (DetailPoint{0, 0, 0}));
  EXPECT_NEAR(cloud.frame.offset[0], 0, 1e-9);
  EXPECT_NEAR(cloud.frame.offset[1], 0, 1e-9);
}

TEST(PointCloud, FeetBecomeMetresAndThePlaceIsTheCoordinateInMetres) {
  LasFixture fixture = corners();
  fixture.geo_keys = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 2225};  // California 1, US feet
  fixture.offset = {6000000, 2000000, 0};
  const PointCloud cloud = read_las(fixture);
  const double foot_m = 1200.0 / 3937.0;
  EXPECT_NEAR(cloud.units_m[0], foot_m, 1e-12);
  EXPECT_NEAR(cloud.frame.step_m[0], 0.01 * foot_m, 1e-14);
  EXPECT_NEAR(cloud.frame.step_m[2], 0.01 * foot_m, 1e-14);
  EXPECT_NEAR(cloud.frame.place(cloud.points[0])[0], 6000001 * foot_m, 1e-6);
  EXPECT_THAT(cloud.crs_name, HasSubstr("California zone 1"));
  EXPECT_THAT(cloud.assumptions, ElementsAre(HasSubstr("nothing about heights")));
}

TEST(PointCloud, GeoKeysMayDefineAProjectionOfTheirOwn) {
  LasFixture fixture = corners();
  // A transverse Mercator in feet around 117 west: which key, where its value is, how many, it.
  fixture.geo_keys = {1,    1,     0, 11,                                                  //
                      1024, 0,     1, 1,     2048, 0,     1, 4326, 3072, 0,     1, 32767,  //
                      3074, 0,     1, 32767, 3075, 0,     1, 1,    3076, 0,     1, 9002,   //
                      3080, 34736, 1, 0,     3081, 34736, 1, 1,    3082, 34736, 1, 2,      //
                      3083, 34736, 1, 3,     3092, 34736, 1, 4};
  fixture.geo_doubles = {-117, 0, 500000, 0, 0.9996};
  const PointCloud own = read_las(fixture);
  EXPECT_EQ(own.units_m[0], 0.3048);
  EXPECT_THAT(own.crs_wkt, HasSubstr("Transverse Mercator"));
  EXPECT_THAT(own.crs_wkt, HasSubstr("-117"));
  fixture.geo_doubles.clear();
  fixture.geo_keys = {1, 1, 0, 2, 1024, 0, 1, 1, 3072, 0, 1, 32611};
  const PointCloud cloud = read_las(fixture);
  EXPECT_EQ(cloud.crs_name, "WGS 84 / UTM zone 11N");
  EXPECT_EQ(cloud.units_m[0], 1);
}

TEST(PointCloud, KeysThatNameOnlyAUnitGiveTheUnitAndNoCrs) {
  LasFixture fixture = corners();
  fixture.geo_keys = {1, 1, 0, 3, 1024, 0, 1, 1, 3072, 0, 1, 32767, 3076, 0, 1, 9002};
  const PointCloud cloud = read_las(fixture);
  EXPECT_EQ(cloud.units_m, (std::array{0.3048, 0.3048, 0.3048}));
  EXPECT_EQ(cloud.crs_wkt, "");
  EXPECT_THAT(cloud.assumptions,
              ElementsAre(HasSubstr("no CRS, but a unit"), HasSubstr("nothing about heights")));
}

TEST(PointCloud, TheUsersCrsGoesBeforeTheFiles) {
  LasFixture fixture = corners();
  fixture.wkt = "no CRS at all";
  EXPECT_THAT(refusal_of([&] { read_las(fixture); }), HasSubstr("--source-crs"));
  EXPECT_EQ(read_las(fixture, {.source_crs = "EPSG:32611"}).crs_name, "WGS 84 / UTM zone 11N");
  EXPECT_THROW(read_las(fixture, {.source_crs = "nonsense"}), UsageError);
}

TEST(PointCloud, ItsCrsOpensNoFile) {
  LasFixture fixture = corners();
  fixture.wkt =
      "GEOGCS[\"a\",DATUM[\"b\",SPHEROID[\"c\",6378137,298.257223563],"
      "EXTENSION[\"PROJ4_GRIDS\",\"/dev/zero\"]],PRIMEM[\"Greenwich\",0],"
      "UNIT[\"degree\",0.0174532925199433]]";
  EXPECT_THAT(refusal_of([&] { read_las(fixture); }),
              AllOf(HasSubstr("'/dev/zero'"), HasSubstr("--source-crs")));
  EXPECT_EQ(read_las(fixture, {.source_crs = "EPSG:32611"}).crs_name, "WGS 84 / UTM zone 11N");
}

TEST(PointCloud, DegreesBecomeMetresAtTheMiddleLatitude) {
  LasFixture fixture;
  fixture.scale = {1e-7, 1e-7, 0.01};
  fixture.offset = {8, 46, 0};
  // 0.02 degrees around 46 north: 1549.3 m along the parallel, 2223.0 m along the meridian.
  fixture.points = {{{0, -100000, 0}}, {{200000, -100000, 0}}, {{0, 100000, 0}}};
  const PointCloud cloud = read_las(fixture, {.source_crs = "EPSG:4326"});
  const auto a = cloud.frame.place(cloud.points[0]);
  const auto north = cloud.frame.place(cloud.points[1]);
  const auto east = cloud.frame.place(cloud.points[2]);
  EXPECT_NEAR(east[0] - a[0], 1549.3, 0.2);
  EXPECT_NEAR(north[1] - a[1], 2223.0, 0.2);
  EXPECT_EQ(cloud.frame.step_m[0], cloud.frame.step_m[1]);
  EXPECT_NEAR(a[0] / cloud.units_m[0], 8, 1e-8);
  EXPECT_NEAR(a[1] / cloud.units_m[1], 45.99, 1e-8);
  fixture.offset = {500000, 4000000, 0};
  EXPECT_THAT(refusal_of([&] { read_las(fixture, {.source_crs = "EPSG:4326"}); }),
              HasSubstr("latitude"));
}

TEST(PointCloud, ClassesWithheldAndNoiseAreLeftOutByName) {
  LasFixture fixture = corners();
  for (LasFixturePoint& p : fixture.points) p.classification = 2;
  fixture.points.push_back({{5, 5, 5}, 7});
  fixture.points.push_back({{6, 6, 6}, 18});
  fixture.points.push_back({{7, 7, 7}, 2, true});
  fixture.points.push_back({{8, 8, 8}, 5});
  const PointCloud all = read_las(fixture);
  EXPECT_EQ(all.points.size(), 5U);
  EXPECT_EQ(left_out(all.counts), "1 marked as withheld, 2 classified as noise");
  const PointCloud ground = read_las(fixture, {.classes = parse_point_classes("ground")});
  EXPECT_EQ(ground.points.size(), 4U);
  EXPECT_EQ(left_out(ground.counts), "1 marked as withheld, 3 of other classes");
  EXPECT_EQ(read_las(fixture, {.classes = {2, 7}}).points.size(), 5U);
  EXPECT_THAT(refusal_of([&] { read_las(fixture, {.classes = {9}}); }), HasSubstr("0 of its 8"));
}

TEST(PointCloud, ClassesAreGroundAndNumbers) {
  EXPECT_THAT(parse_point_classes("6,ground,255,2"), ElementsAre(2, 6, 255));
  for (const char* bad : {"", "2,", "256", "-1", "tree", "2 "}) {
    EXPECT_THROW(parse_point_classes(bad), UsageError) << bad;
  }
}

TEST(PointCloud, ThinningKeepsThePointNearestToEachSquaresCentre) {
  LasFixture fixture;
  fixture.offset = {-3, 7, 0};
  const std::uint64_t seed = 77;
  SCOPED_TRACE(seed);
  std::mt19937_64 random(seed);
  const auto number = [&](unsigned most) { return static_cast<std::int32_t>(random() % most); };
  for (int k = 0; k < 3000; ++k) {
    fixture.points.push_back({{number(2000), number(2000), number(50)}});
  }
  struct Best {
    double distance = 1e9;
    int z = 0;
  };
  std::map<std::pair<int, int>, Best> expected;
  for (const LasFixturePoint& p : fixture.points) {
    const double x = (-3 + 0.01 * p.at[0]) / 2;
    const double y = (7 + 0.01 * p.at[1]) / 2;
    const std::pair square{static_cast<int>(std::floor(x)), static_cast<int>(std::floor(y))};
    const double distance = std::hypot(x - square.first - 0.5, y - square.second - 0.5);
    Best& best = expected[square];
    if (distance < best.distance) best = {distance, p.at[2]};
  }
  const PointCloud cloud = read_las(fixture, {.thin_m = 2});
  EXPECT_EQ(cloud.points.size(), expected.size());
  EXPECT_EQ(cloud.counts.thinned, 3000 - expected.size());
  for (const DetailPoint& p : cloud.points) {
    const auto at = cloud.frame.place(p);
    const std::pair square{static_cast<int>(std::floor(at[0] / 2)),
                           static_cast<int>(std::floor(at[1] / 2))};
    ASSERT_TRUE(expected.count(square));
    const double distance =
        std::hypot(at[0] / 2 - square.first - 0.5, at[1] / 2 - square.second - 0.5);
    EXPECT_NEAR(distance, expected[square].distance, 1e-9);
  }
}

TEST(PointCloud, TheFilesOrderDoesNotMatter) {
  const std::uint64_t seed = 4711;
  SCOPED_TRACE(seed);
  std::mt19937_64 random(seed);
  LasFixture fixture;
  for (int k = 0; k < 2000; ++k) {
    const auto number = [&] { return static_cast<std::int32_t>(random() % 40); };
    fixture.points.push_back({{number(), number(), number()}});
  }
  for (const double thin_m : {0.0, 0.05}) {
    const PointReadOptions options{.thin_m = thin_m, .outlier_m = 0.02};
    const PointCloud first = read_las(fixture, options);
    EXPECT_GT(first.counts.same_place + first.counts.thinned, 0U);
    for (int round = 0; round < 5; ++round) {
      std::shuffle(fixture.points.begin(), fixture.points.end(), random);
      const PointCloud again = read_las(fixture, options);
      EXPECT_EQ(again.points, first.points);
      EXPECT_EQ(again.frame, first.frame);
      EXPECT_EQ(left_out(again.counts), left_out(first.counts));
    }
  }
}

TEST(PointCloud, LoneOutliersGoOnlyWhenAskedForAndClustersStay) {
  LasFixture fixture;
  for (int k = 0; k < 1600; ++k) {
    const int x = k % 40;
    const int y = k / 40;
    const bool is_lone = (x == 10 && y == 10) || (x == 30 && y == 5);
    // Two in one cell or in neighbouring ones, as they fall.
    const bool is_pair = y == 30 && (x == 12 || x == 13 || x == 25 || x == 26);
    const bool is_tower = is_pair || (x >= 20 && x <= 21 && y >= 20 && y <= 21);
    const int cliff = x < 5 ? 3000 : 0;
    fixture.points.push_back({{100 * x, 100 * y, is_lone || is_tower ? 5000 : cliff}});
  }
  fixture.points[35 * 40 + 35].at[2] = -5000;
  EXPECT_EQ(read_las(fixture).points.size(), 1600U);
  const PointCloud cloud = read_las(fixture, {.outlier_m = 20});
  EXPECT_EQ(cloud.counts.outliers, 3U);
  EXPECT_EQ(std::count_if(cloud.points.begin(), cloud.points.end(),
                          [](const DetailPoint& p) { return p.z == 5000; }),
            8);
}

TEST(PointFile, IsToldByItsNameElseByItsFirstBytes) {
  const TemporaryFolder folder;
  const std::vector<std::uint8_t> las = las_bytes(corners());
  folder.put("noname", std::string(las.begin(), las.end()));
  folder.put("points.dat", "0 0 0\n1 0 0\n0 1 0\n");
  folder.put("binary.dat", std::string(100, '\0'));
  folder.put("terrain.tif", "II*");
  folder.put("grid.txt", "NCOLS 4\nnrows 3\n");
  EXPECT_TRUE(is_point_file(folder.path() / "noname"));
  EXPECT_TRUE(is_point_file("any.LAZ"));
  EXPECT_TRUE(is_point_file("any.csv"));
  EXPECT_FALSE(is_point_file(folder.path() / "terrain.tif"));
  EXPECT_FALSE(is_point_file(folder.path() / "grid.txt"));
  EXPECT_EQ(read_point_cloud(folder.path() / "noname", {}).points.size(), 4U);
  EXPECT_EQ(read_point_cloud(folder.path() / "points.dat", {}).points.size(), 3U);
  const auto refusal = [&](const char* name) {
    return refusal_of([&] { read_point_cloud(folder.path() / name, {}); });
  };
  EXPECT_THAT(refusal("binary.dat"), HasSubstr("neither LAS nor text"));
  EXPECT_THAT(refusal("absent.las"), HasSubstr("No such file"));
  EXPECT_THAT(refusal("absent"), HasSubstr("No such file"));
}

TEST(PointFile, CompressedPointsAreRefusedWithTheRemedyWhateverTheName) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> bytes = las_bytes(corners());
  bytes[104] |= 0x80;
  for (const char* name : {"points.las", "points.laz", "points"}) {
    folder.put(name, std::string(bytes.begin(), bytes.end()));
    const std::string what = refusal_of([&] { read_point_cloud(folder.path() / name, {}); });
    EXPECT_THAT(what, HasSubstr("LAZ")) << name;
    EXPECT_THAT(what, HasSubstr("laszip -i")) << name;
  }
}

TEST(PointFile, ARealSurveyInFeetIsReadWhole) {
  const auto path = testing::real_data("autzen_trim_7.las");
  if (!path) GTEST_SKIP() << "no autzen_trim_7.las";
  const PointCloud cloud = read_point_cloud(*path, {});
  EXPECT_EQ(cloud.counts.in_file, 110000U);
  EXPECT_EQ(cloud.points.size(), 109993U);
  EXPECT_EQ(left_out(cloud.counts), "7 at the same x and y as a lower one");
  EXPECT_EQ(cloud.units_m, (std::array{0.3048, 0.3048, 0.3048}));
  EXPECT_THAT(cloud.crs_name, HasSubstr("Lambert"));
  double low = 1e9;
  double high = -1e9;
  for (const DetailPoint& p : cloud.points) {
    low = std::min(low, cloud.frame.place(p)[2]);
    high = std::max(high, cloud.frame.place(p)[2]);
  }
  EXPECT_NEAR(low, 406.26 * 0.3048, 1e-6);
  EXPECT_NEAR(high, 520.51 * 0.3048, 1e-6);
  EXPECT_NEAR(cloud.frame.offset[0], 636001.76 * 0.3048, 1e-6);
  EXPECT_NEAR(cloud.frame.offset[1], 848935.20 * 0.3048, 1e-6);
  const PointCloud ground = read_point_cloud(*path, {.classes = {2}, .thin_m = 5});
  EXPECT_EQ(ground.counts.other_class, 83893U);
  EXPECT_EQ(ground.points.size() + ground.counts.thinned, 26107U);
}

TEST(PointFile, ARealLazFileIsRefusedWithTheRemedy) {
  const auto path = testing::real_data("autzen_trim.laz");
  if (!path) GTEST_SKIP() << "no autzen_trim.laz";
  EXPECT_THAT(refusal_of([&] { read_point_cloud(*path, {}); }), HasSubstr("pdal translate"));
}

}  // namespace
}  // namespace qmpipe::point_cloud_test
