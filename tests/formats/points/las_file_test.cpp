// The LAS parser on files written byte by byte, whole and damaged.
#include "formats/points/las_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>

#include "formats/bytes/little_endian.h"
#include "tests/support/las_fixture.h"

namespace qmpipe::las_file_test {
namespace {

using ::testing::HasSubstr;
using testing::las_bytes;
using testing::LasFixture;
using testing::source_of;
using Bytes = std::vector<std::uint8_t>;

LasFixture three_points() {
  LasFixture fixture;
  fixture.points = {{{1, -2, 3}, 2}, {{-2000000000, 5, 2000000000}, 1}, {{7, 8, 9}, 7, true}};
  return fixture;
}

std::vector<LasPoint> points_in(const Bytes& bytes) {
  const ByteSource source = source_of(bytes);
  const auto header = read_las_header(source);
  EXPECT_TRUE(header.ok()) << (header.ok() ? "" : header.error().message);
  std::vector<LasPoint> points;
  if (!header.ok()) return points;
  const auto error =
      for_each_las_point(source, *header, [&](const LasPoint& p) { points.push_back(p); });
  EXPECT_FALSE(error.has_value());
  return points;
}

std::string refusal_of(const Bytes& bytes) {
  const auto header = read_las_header(source_of(bytes));
  return header.ok() ? "" : header.error().message;
}

template <class T>
Bytes with(Bytes bytes, std::size_t at, T value) {
  store_little_endian(bytes.data() + at, value);
  return bytes;
}

TEST(LasFile, EveryFormatOfEveryVersionGivesItsPointsBack) {
  for (const int minor : {0, 1, 2, 3, 4}) {
    for (int format = 0; format <= 10; ++format) {
      for (const std::size_t extra : {std::size_t{0}, std::size_t{9}}) {
        if (format >= 6 && minor < 4) continue;
        SCOPED_TRACE(::testing::Message() << "1." << minor << " format " << format);
        LasFixture fixture = three_points();
        fixture.minor_version = minor;
        fixture.format = format;
        fixture.extra_bytes = extra;
        if (minor == 0) fixture.points[2].is_withheld = false;
        const std::vector<LasPoint> points = points_in(las_bytes(fixture));
        ASSERT_EQ(points.size(), fixture.points.size());
        for (std::size_t k = 0; k < points.size(); ++k) {
          EXPECT_EQ(points[k].at, fixture.points[k].at);
          EXPECT_EQ(points[k].classification, fixture.points[k].classification);
          EXPECT_EQ(points[k].is_withheld, fixture.points[k].is_withheld);
          EXPECT_EQ(points[k].is_noise, fixture.points[k].classification == 7);
        }
      }
    }
  }
}

TEST(LasFile, NewFormatsHaveClassesUpTo255AndOldOnesUpTo31) {
  LasFixture fixture;
  fixture.points = {{{0, 0, 0}, 18}, {{0, 0, 0}, 255}};
  const std::vector<LasPoint> points = points_in(las_bytes(fixture));
  EXPECT_TRUE(points.at(0).is_noise);
  EXPECT_EQ(points.at(1).classification, 255);
  fixture.format = 1;
  fixture.points = {{{0, 0, 0}, 18}, {{0, 0, 0}, 31}};
  Bytes bytes = las_bytes(fixture);
  bytes[375 + 28 + 15] |= 0x60;  // synthetic and key point
  const std::vector<LasPoint> old_points = points_in(bytes);
  EXPECT_FALSE(old_points.at(0).is_noise);
  EXPECT_EQ(old_points.at(1).classification, 31);
}

TEST(LasFile, ManyPointsAreReadInPiecesWithoutALoss) {
  LasFixture fixture;
  fixture.points.resize(100'000);
  for (std::size_t k = 0; k < fixture.points.size(); ++k) {
    fixture.points[k].at = {static_cast<std::int32_t>(k), 0, 0};
  }
  const std::vector<LasPoint> points = points_in(las_bytes(fixture));
  ASSERT_EQ(points.size(), fixture.points.size());
  for (std::size_t k = 0; k < points.size(); ++k) {
    ASSERT_EQ(points[k].at[0], static_cast<std::int32_t>(k));
  }
}

TEST(LasFile, TheCrsIsFoundInRecordsBeforeAndAfterThePoints) {
  for (const bool at_end : {false, true}) {
    LasFixture fixture = three_points();
    fixture.wkt = "LOCAL_CS[\"here\"]";
    fixture.wkt_at_end = at_end;
    fixture.geo_keys = {1, 1, 0, 1, 3072, 0, 1, 32610};
    const Bytes bytes = las_bytes(fixture);
    const auto header = read_las_header(source_of(bytes));
    ASSERT_TRUE(header.ok());
    EXPECT_EQ(header->crs.wkt, fixture.wkt);
    EXPECT_EQ(header->crs.geo_keys, fixture.geo_keys);
  }
}

TEST(LasFile, EveryTruncationIsRefused) {
  LasFixture fixture = three_points();
  fixture.wkt = "LOCAL_CS[\"here\"]";
  for (const bool at_end : {false, true}) {
    fixture.wkt_at_end = at_end;
    const Bytes bytes = las_bytes(fixture);
    for (std::size_t size = 0; size < bytes.size(); ++size) {
      const auto cut = bytes.begin() + static_cast<std::ptrdiff_t>(size);
      EXPECT_NE(refusal_of(Bytes(bytes.begin(), cut)), "") << size;
    }
  }
}

TEST(LasFile, ACutFileSaysHowManyPointsAreThere) {
  Bytes bytes = las_bytes(three_points());
  bytes.pop_back();
  EXPECT_THAT(refusal_of(bytes), HasSubstr("2 of its 3 points are there"));
}

TEST(LasFile, AWrongFieldOfTheHeaderIsNamed) {
  const Bytes good = las_bytes(three_points());
  ASSERT_EQ(refusal_of(good), "");
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(refusal_of(with<std::uint8_t>(good, 0, 'X')), HasSubstr("LASF"));
  EXPECT_THAT(refusal_of(with<std::uint8_t>(good, 24, 2)), HasSubstr("LAS 2.4"));
  EXPECT_THAT(refusal_of(with<std::uint8_t>(good, 25, 5)), HasSubstr("LAS 1.5"));
  EXPECT_THAT(refusal_of(with<std::uint8_t>(good, 104, 11)), HasSubstr("format is 11"));
  EXPECT_THAT(refusal_of(with<std::uint8_t>(good, 104, 0x86)), HasSubstr("LAZ"));
  EXPECT_THAT(refusal_of(with<std::uint16_t>(good, 94, 374)), HasSubstr("header has 374 bytes"));
  EXPECT_THAT(refusal_of(with<std::uint32_t>(good, 96, 300)), HasSubstr("begin at byte 300"));
  EXPECT_THAT(refusal_of(with<std::uint32_t>(good, 96, 9999)), HasSubstr("begin at byte 9999"));
  EXPECT_THAT(refusal_of(with<std::uint32_t>(good, 100, 1)), HasSubstr("variable length record"));
  EXPECT_THAT(refusal_of(with<std::uint16_t>(good, 105, 29)), HasSubstr("has 29 bytes"));
  EXPECT_THAT(refusal_of(with<std::uint16_t>(good, 105, 0)), HasSubstr("has 0 bytes"));
  EXPECT_THAT(refusal_of(with<std::uint32_t>(good, 107, 4)), HasSubstr("contradicts"));
  EXPECT_THAT(refusal_of(with<std::uint64_t>(good, 247, ~0ULL)), HasSubstr("3 of its 1844674"));
  EXPECT_THAT(refusal_of(with<double>(good, 131, 0)), HasSubstr("scale of x"));
  EXPECT_THAT(refusal_of(with<double>(good, 139, -1)), HasSubstr("scale of y"));
  EXPECT_THAT(refusal_of(with<double>(good, 147, nan)), HasSubstr("scale of z"));
  EXPECT_THAT(refusal_of(with<double>(good, 163, nan)), HasSubstr("offset of y"));
  EXPECT_THAT(refusal_of(with<std::uint32_t>(good, 243, 1)), HasSubstr("variable length record"));
  EXPECT_THAT(refusal_of(with<std::uint64_t>(with<std::uint32_t>(good, 243, 1), 235, ~0ULL)),
              HasSubstr("extended records"));
}

TEST(LasFile, DamagedBytesGiveAnErrorOrPointsAndNothingElse) {
  LasFixture fixture = three_points();
  fixture.wkt = "LOCAL_CS[\"here\"]";
  fixture.wkt_at_end = true;
  fixture.geo_keys = {1, 1, 0, 1, 3072, 0, 1, 32610};
  const Bytes good = las_bytes(fixture);
  const std::uint64_t seed = 20260611;
  SCOPED_TRACE(seed);
  std::mt19937_64 random(seed);
  int refused = 0;
  for (int round = 0; round < 20'000; ++round) {
    Bytes bytes = good;
    for (std::uint64_t n = 1 + random() % 4; n > 0; --n) {
      bytes[94 + random() % (bytes.size() - 94)] = static_cast<std::uint8_t>(random());
    }
    const ByteSource source = source_of(bytes);
    const auto header = read_las_header(source);
    if (!header.ok()) {
      ++refused;
      continue;
    }
    std::uint64_t count = 0;
    EXPECT_FALSE(for_each_las_point(source, *header, [&](const LasPoint&) { ++count; }));
    EXPECT_EQ(count, header->point_count);
  }
  EXPECT_GT(refused, 1000);
  EXPECT_LT(refused, 20'000);
}

}  // namespace
}  // namespace qmpipe::las_file_test
