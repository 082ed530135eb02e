// read_point_cloud() on text: its forms, its faults, the grid's step.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>

#include "formats/bytes/errors.h"
#include "formats/points/point_cloud.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::point_text_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::TemporaryFolder;

PointCloud read_text(const std::string& text, const PointReadOptions& options = {}) {
  const TemporaryFolder folder;
  folder.put("points.xyz", text);
  return read_point_cloud(folder.path() / "points.xyz", options);
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

TEST(PointText, EverySeparatorAndLineEndGivesTheSamePoints) {
  const PointCloud expected = read_text("10.25 20 3\n11 20 4\n10.25 21.5 5.5\n");
  EXPECT_THAT(expected.points,
              ElementsAre(DetailPoint{0, 0, 30}, DetailPoint{0, 150, 55}, DetailPoint{75, 0, 40}));
  EXPECT_EQ(expected.frame.step_m, (std::array{0.01, 0.01, 0.1}));
  for (const char* text : {"# a comment\n10.25,20,3\n11, 20 ,4\n10.25,21.5,5.5",
                           "10.25;20;3\r\n11;20;4\r\n\r\n10.25;21.5;5.5\r\n",
                           "\t10.25\t20\t3\t99\n11\t20\t4\tred\n10.25\t21.5\t5.5\n",
                           "Z,name,X,Y\n3,a,10.25,20\n4,b,11,20\n5.5,c,10.25,21.5\n",
                           "\xEF\xBB\xBF\"x\";\"y\";\"z\"\n10.25;20;3\n11;20;4\n10.25;21.5;5.5\n",
                           "//X Y Z\n1.025e1 2e+1 +3\n11 20 4\n10.25 21.5 5.5\n"}) {
    const PointCloud cloud = read_text(text);
    EXPECT_EQ(cloud.points, expected.points) << text;
    EXPECT_EQ(cloud.frame, expected.frame) << text;
  }
}

TEST(PointText, ALineThatCannotBeReadIsNamed) {
  const auto refusal = [](const char* text) { return refusal_of([&] { read_text(text); }); };
  EXPECT_THAT(refusal("1 2 3\n\n1 2\n"), HasSubstr("line 3 has 2 columns"));
  EXPECT_THAT(refusal("1 2 3\n1 2 high\n"), HasSubstr("line 2: 'high' in column 3"));
  EXPECT_THAT(refusal("1;2;3\n1,5;2;3\n"), HasSubstr("line 2: '1,5' in column 1"));
  EXPECT_THAT(refusal("x y name\n1 2 3\n"), HasSubstr("none of them z"));
  EXPECT_THAT(refusal("1 2 3\n1e999 2 3\n"), HasSubstr("line 2"));
  EXPECT_THAT(refusal(std::string(100'000, '1').c_str()), HasSubstr("line 1 is longer"));
  EXPECT_THAT(refusal("# nothing\n"), HasSubstr("0 of its 0 points"));
}

TEST(PointText, NonFiniteCoordinatesAreLeftOutAndCounted) {
  const PointCloud cloud = read_text("0 0 nan\n0 inf 1\n0 0 1\n1 0 1\n0 1 1\n-nan 0 0\n");
  EXPECT_EQ(cloud.points.size(), 3U);
  EXPECT_EQ(cloud.counts.non_finite, 3U);
  EXPECT_EQ(cloud.counts.in_file, 6U);
}

TEST(PointText, HugeOffsetsCostNoDigits) {
  const PointCloud cloud = read_text(
      "637179.224 5400000.001 406.26\n637179.225 5400000.001 406.27\n"
      "637200.001 5400001.999 500.00\n",
      {.source_crs = "EPSG:32611"});
  EXPECT_EQ(cloud.frame.step_m, (std::array{0.001, 0.001, 0.01}));
  EXPECT_THAT(cloud.points, ElementsAre(DetailPoint{0, 0, 40626}, DetailPoint{1, 0, 40627},
                                        DetailPoint{20777, 1998, 50000}));
  EXPECT_NEAR(cloud.frame.place(cloud.points[0])[1], 5400000.001, 1e-6);
}

TEST(PointText, MoreDigitsThanTheGridHoldsBecomeACoarserStep) {
  const PointCloud cloud = read_text("0.1234567891 0 0\n100000 0 0\n0 100000 0\n");
  EXPECT_EQ(cloud.frame.step_m[0], 0.001);
  EXPECT_EQ(cloud.points[1].x, 123);
  EXPECT_THAT(refusal_of([] { read_text("0 0 0\n1e10 0 0\n0 1e10 0\n0 5 0\n"); }),
              HasSubstr("from the middle of x"));
}

TEST(PointText, DegreesAreReadToCentimetres) {
  const PointCloud cloud =
      read_text("lon,lat,height\n8.5,46,3\n9,46,4\n8.5,46.5,5\n", {.source_crs = "EPSG:4326"});
  for (const DetailPoint& p : cloud.points) {
    const auto at = cloud.frame.place(p);
    const double lon = at[0] / cloud.units_m[0];
    const double lat = at[1] / cloud.units_m[1];
    EXPECT_NEAR(lon, p.z == 4 ? 9 : 8.5, 1e-7);
    EXPECT_NEAR(lat, p.z == 5 ? 46.5 : 46, 1e-7);
  }
}

TEST(PointText, ClassesAreAUsageError) {
  EXPECT_THROW(read_text("0 0 0\n1 0 0\n0 1 0\n", {.classes = {2}}), UsageError);
}

TEST(PointText, OfPointsAtOnePlaceTheLowestIsKept) {
  const PointCloud cloud = read_text("0 0 5\n0 0 3\n0 0 4\n1 0 1\n0 1 1\n");
  EXPECT_EQ(cloud.points.front(), (DetailPoint{0, 0, 3}));
  EXPECT_EQ(cloud.points.size(), 3U);
  EXPECT_EQ(cloud.counts.same_place, 2U);
}

}  // namespace
}  // namespace qmpipe::point_text_test
