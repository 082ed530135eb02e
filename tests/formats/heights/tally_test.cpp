// Values that can be no heights: found pixel by pixel, told with an option that works, and nothing said
// of good data.
#include "formats/heights/tally.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>
#include <regex>

#include "formats/bytes/errors.h"
#include "formats/heights/value_counts.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::testing::tally_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// What a shell makes of --void's text in a message.
HeightOptions advice_in(const std::string& text) {
  const std::regex pattern("--void (\"([^\"]*)\"|[^ ;]+)");
  std::smatch found;
  if (!std::regex_search(text, found, pattern)) {
    ADD_FAILURE() << "no --void in: " << text;
    return {};
  }
  const std::string typed = found[2].matched ? found[2].str() : found[1].str();
  const Result<VoidValues> voids = void_values_named(typed);
  EXPECT_TRUE(voids) << typed;
  HeightOptions options;
  if (voids) options.voids = *voids;
  return options;
}

struct Reading {
  std::vector<double> heights_m;
  std::vector<HeightFinding> findings;
  std::string refusal;  // empty: none

  std::string advice() const {
    return !refusal.empty() ? refusal : findings.empty() ? "" : findings.front().text;
  }
};

enum class Through { kCache, kGdal };

Reading read_with(const std::string& path, const HeightOptions& options, HeightGuard guard,
                  Through through) {
  Reading reading;
  const auto tally = std::make_shared<HeightTally>(guard);
  OpenOptions open{.heights = options, .tally = tally};
  if (through == Through::kCache) open.cache = std::make_shared<SourceBlockCache>(1 << 20);
  const auto source = RasterSource::open(path, open);
  try {
    reading.heights_m = read_all(*source);
    // Once more, which must not be counted.
    if (through == Through::kCache) read_all(*source);
    reading.findings = tally->findings(options);
  } catch (const IoError& error) {
    reading.refusal = error.what();
  }
  return reading;
}

TEST(ValueCounts, AreExactInWhateverPiecesValuesCome) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE(seed);
    std::mt19937 random(seed);
    const auto distinct = static_cast<std::uint32_t>(1 + random() % 40);
    std::vector<double> values(1 + random() % 3000);
    std::map<double, std::int64_t> expected;
    std::int64_t count = 0;
    for (double& value : values) {
      value = random() % 9 == 0 ? kNaN : static_cast<double>(random() % distinct) - 10;
      if (std::isnan(value)) continue;
      ++expected[value];
      ++count;
    }
    ValueCounts whole;
    for (std::size_t at = 0; at < values.size();) {
      const std::size_t size = std::min<std::size_t>(values.size() - at, 1 + random() % 400);
      // Some directly, some by blocks that begin with what is known.
      ValueCounts block = whole.begun();
      ValueCounts& into = random() % 2 == 0 ? block : whole;
      into.add(std::span(values).subspan(at, size));
      if (&into == &block) whole.add(block);
      at += size;
    }
    EXPECT_EQ(whole.count(), count);
    const std::size_t kept = std::min(ValueCounts::kKept, expected.size());
    ASSERT_EQ(whole.lowest().size(), kept);
    ASSERT_EQ(whole.highest().size(), kept);
    auto low = expected.begin();
    auto high = expected.rbegin();
    for (std::size_t k = 0; k < kept; ++k, ++low, ++high) {
      EXPECT_EQ(whole.lowest()[k], (CountedValue{low->first, low->second}));
      EXPECT_EQ(whole.highest()[k], (CountedValue{high->first, high->second}));
    }
  }
}

TEST(VoidValues, AreReadAsTheyAreWritten) {
  for (const char* text : {"-9999", "0,-32768", "<-12000", ">9000", "1e+20,<-5.5,>9000.25"}) {
    const Result<VoidValues> voids = void_values_named(text);
    ASSERT_TRUE(voids) << text;
    EXPECT_EQ(text_of(*voids), text);
  }
  for (const char* text : {"", ",", "-9999,", "x", "<", "<-1,<-2", "--1", "nan", "inf", "1e999",
                           "-9999 ", "0x10", "<>3"}) {
    EXPECT_FALSE(void_values_named(text)) << text;
  }
}

// One raster whose terrain has values that are none.
struct Case {
  std::string what;
  std::string type;
  double low;  // of the terrain, raw
  double high;
  std::vector<double> marks;
  bool stops = false;
  double scale = 1;
  double offset = 0;
  std::string unit = {};
  std::optional<double> declared = {};
};

std::vector<Case> cases() {
  return {{"SRTM's", "Int16", 100, 900, {-32768}, true},
          {"off by one", "Int16", 100, 900, {-32767}, true, 1, 0, "", -32768},
          {"the other end", "Int16", 100, 900, {32767}, true},
          {"nines", "Int16", 100, 900, {-9999}},
          {"nines, off by one", "Int16", 100, 900, {-9998}, false, 1, 0, "", -9999},
          {"nines, the other off by one", "Int16", 100, 900, {-10000}, false, 1, 0, "", -9999},
          {"two nines", "Int16", 100, 900, {-99}},
          {"three nines", "Float32", -4, 900, {-999}},
          {"five nines", "Int32", -4, 900, {-99999}, true},
          {"positive nines", "Int16", 100, 900, {9999}, true},
          {"an unsigned -9999", "UInt16", 100, 900, {55537}, true, 1, 0, "", -9999},
          {"an unsigned -1", "UInt16", 100, 900, {65535}, true},
          {"an unsigned -1 of 32 bits", "UInt32", 100, 900, {4294967295.0}, true},
          {"the least of 32 bits", "Int32", 100, 900, {-2147483648.0}, true},
          {"NaN made whole", "Int16", 100, 900, {-32768}, true, 1, 0, "", kNaN},
          {"a float", "Float32", 100, 900, {-9999.9}},
          {"a large float", "Float32", 100, 900, {-1e10}, true},
          {"a larger float", "Float32", 100, 900, {1e20}, true},
          {"a double", "Float64", 100, 900, {-9999.123}},
          {"several", "Float32", 100, 900, {-32768, -9999, 1e10}, true},
          {"many", "Int16", 100, 900, {-32768, -32767, -32766, -32765, -20000}, true},
          {"both ends", "Int16", 100, 900, {-32768, 32767}, true},
          {"scaled raw", "Int16", 1000, 9000, {-32768}, false, 0.1},
          {"scaled nines", "Int32", 1000, 9000, {-99990}, false, 0.1},
          {"centimetres", "Int32", 10000, 90000, {-9999}, false, 0.01},
          {"an offset", "Int16", 0, 9000, {32767}, false, 0.1, -500},
          {"feet", "Int16", 300, 3000, {-9999}, false, 1, 0, "ft"},
          {"feet, beyond", "Int16", 300, 3000, {-32767, 32767}, true, 1, 0, "ft"},
          {"depths turned", "Int16", 10, 5000, {32767}, true, -1},
          {"bathymetry", "Float32", -5000, -3, {-32767}, true},
          {"bathymetry, positive nines", "Float32", -5000, -3, {9999}, true},
          {"a city by the sea", "Float32", -1, 40, {-99}},
          {"unusual", "Float32", 3, 800, {-4242}}};
}

TEST(HeightTally, TheOptionThatItNamesWorksForEveryKindOfUndeclaredVoid) {
  const TemporaryFolder folder;
  std::uint32_t seed = 0;
  for (const Case& one : cases()) {
    SCOPED_TRACE(one.what + ", seed " + std::to_string(++seed));
    std::mt19937 random(seed);
    RasterFixture fixture{.width = 90, .height = 70, .type = one.type};
    fixture.scale = one.scale;
    fixture.offset = one.offset;
    fixture.unit = one.unit;
    fixture.void_value = one.declared;
    if (seed % 3 == 0) {
      fixture.creation_options = {"TILED=YES", "BLOCKXSIZE=16", "BLOCKYSIZE=16"};
    }
    std::vector<bool> is_void(90 * 70);
    for (std::size_t k = 0; k < is_void.size(); ++k) is_void[k] = random() % 13 == 0;
    const bool is_whole = one.type.find("Float") == std::string::npos;
    fixture.value = [&](int c, int r) {
      const auto k = static_cast<std::size_t>(r * 90 + c);
      if (is_void[k]) return one.marks[k % one.marks.size()];
      const double share = static_cast<double>((c * 31 + r * 17) % 997) / 996;
      const double value = one.low + (one.high - one.low) * share;
      return is_whole ? std::round(value) : value;
    };
    const std::string path = file_in(folder, std::to_string(seed) + ".tif");
    write_raster(path, fixture);
    for (const Through through : {Through::kCache, Through::kGdal}) {
      const Reading first = read_with(path, {}, HeightGuard::kStop, through);
      EXPECT_EQ(!first.refusal.empty(), one.stops) << first.advice();
      if (one.stops) {
        EXPECT_THAT(first.refusal, HasSubstr("--allow-heights"));
      }
      const HeightOptions options = advice_in(first.advice());
      const auto voids = std::count(is_void.begin(), is_void.end(), true);
      if (one.marks.size() == 1) {
        EXPECT_THAT(first.advice(), HasSubstr(std::to_string(voids) + " of 6300 pixels"));
      }
      const Reading second = read_with(path, options, HeightGuard::kStop, through);
      EXPECT_EQ(second.refusal, "");
      EXPECT_THAT(second.findings, IsEmpty()) << second.advice();
      ASSERT_THAT(second.heights_m, SizeIs(is_void.size()));
      for (std::size_t k = 0; k < is_void.size(); ++k) {
        ASSERT_EQ(std::isnan(second.heights_m[k]), is_void[k]) << k;
      }
      // Who means it gets it.
      const Reading meant = read_with(path, {}, HeightGuard::kAllow, through);
      EXPECT_EQ(meant.refusal, "");
      EXPECT_TRUE(std::none_of(meant.heights_m.begin(), meant.heights_m.end(),
                               [](double h) { return std::isnan(h); }));
    }
  }
}

TEST(HeightTally, WhatWasGivenAlreadyIsPartOfTheAdvice) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 40, .height = 30, .type = "Int16"};
  fixture.value = [](int c, int r) {
    return c == 3 ? -9999.0 : c == 5 ? 32767.0 : c == 7 ? -20000.0 - r : 100.0 + c;
  };
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  HeightOptions given;
  given.voids = *void_values_named("-9999");
  const Reading first = read_with(path, given, HeightGuard::kStop, Through::kCache);
  const HeightOptions options = advice_in(first.refusal);
  const Reading second = read_with(path, options, HeightGuard::kStop, Through::kCache);
  EXPECT_THAT(second.advice(), IsEmpty());
  EXPECT_EQ(std::count_if(second.heights_m.begin(), second.heights_m.end(),
                          [](double h) { return std::isnan(h); }),
            90);
}

TEST(HeightTally, GoodTerrainIsLeftAlone) {
  const TemporaryFolder folder;
  struct Good {
    std::string type;
    double low;
    double high;
    double scale = 1;
    std::string unit = {};
  };
  const std::vector<Good> goods = {
      {"Int16", -10908, 8848},     {"Float32", -10935.5, -9.5},   {"Int16", -430, -80},
      {"Float32", 0, 0.5},         {"UInt16", 0, 8848},           {"Byte", 0, 255},
      {"Int16", -105, -93},        {"Int16", 20, 29000, 1, "ft"}, {"Int32", 0, 884800, 0.01},
      {"Float32", 8848, 8848},     {"Int16", -9999, -9000},       {"Float64", -1000, 1000},
      {"Int16", -10400, -9300, 1}, {"Float32", -100, 100}};
  std::uint32_t seed = 0;
  for (const Good& good : goods) {
    SCOPED_TRACE(std::to_string(good.low) + ", seed " + std::to_string(++seed));
    std::mt19937 random(seed);
    RasterFixture fixture{.width = 120, .height = 100, .type = good.type};
    fixture.scale = good.scale;
    fixture.unit = good.unit;
    const double phase = static_cast<double>(random() % 1000) / 100;
    fixture.value = [&good, phase](int c, int r) {
      // All values between are there, the outermost ones a few times.
      const double wave = std::sin(phase + c * 0.11) * std::cos(phase - r * 0.07);
      const double value = good.low + (good.high - good.low) * (wave + 1) / 2;
      return good.type.starts_with("Float") ? value : std::round(value);
    };
    const std::string path = file_in(folder, std::to_string(seed) + ".tif");
    write_raster(path, fixture);
    const Reading reading = read_with(path, {}, HeightGuard::kStop, Through::kCache);
    EXPECT_EQ(reading.advice(), "");
  }
}

TEST(HeightTally, HeightsInAnotherUnitAreToldAsSuch) {
  const TemporaryFolder folder;
  struct Unit {
    std::string name;
    double metres;
  };
  for (const Unit& unit : {Unit{"feet", 0.3048}, {"centimetres", 0.01}, {"millimetres", 0.001}}) {
    SCOPED_TRACE(unit.name);
    RasterFixture fixture{.width = 90, .height = 70, .type = "Int32"};
    fixture.value = [&unit](int c, int r) { return std::round((200 + c * 55 + r) / unit.metres); };
    const std::string path = file_in(folder, unit.name + ".tif");
    write_raster(path, fixture);
    const Reading first = read_with(path, {}, HeightGuard::kStop, Through::kGdal);
    EXPECT_THAT(first.refusal, HasSubstr(unit.name));
    std::smatch found;
    const std::regex pattern("--z-scale ([^ ;]+)");
    ASSERT_TRUE(std::regex_search(first.refusal, found, pattern)) << first.refusal;
    HeightOptions options;
    options.z_scale = std::stod(found[1].str());
    const Reading second = read_with(path, options, HeightGuard::kStop, Through::kGdal);
    EXPECT_EQ(second.advice(), "");
    EXPECT_NEAR(second.heights_m[0], 200, 0.2);
    EXPECT_NEAR(second.heights_m[89], 200 + 89 * 55, 0.2);
  }
}

TEST(HeightTally, RastersThatHaveTheSameAreToldInOneSentence) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 10, .height = 10, .type = "Int16"};
  fixture.value = [](int c, int r) { return c == 0 && r < 4 ? -9999.0 : 100.0 + c; };
  const auto tally = std::make_shared<HeightTally>(HeightGuard::kStop);
  for (std::uint32_t number = 0; number < 5; ++number) {
    const std::string path = file_in(folder, std::to_string(number) + ".tif");
    write_raster(path, fixture);
    read_all(*RasterSource::open(path, {.tally = tally, .number = number}));
  }
  const std::vector<HeightFinding> findings = tally->findings({});
  ASSERT_THAT(findings, SizeIs(1));
  EXPECT_THAT(findings[0].path, HasSubstr("0.tif"));
  EXPECT_THAT(findings[0].text, HasSubstr("-9999 stands in 20 of 500 pixels"));
  EXPECT_THAT(findings[0].text, HasSubstr("4 more"));
}

TEST(HeightTally, DeclaredVoidsThatCannotStandInTheBandAreTold) {
  const TemporaryFolder folder;
  for (const auto& [type, declared, is_told] : {std::tuple{"Int16", kNaN, true},
                                                {"UInt16", -9999.0, true},
                                                {"Int16", -9999.5, true},
                                                {"Int16", -9999.0, false},
                                                {"Float32", kNaN, false},
                                                {"UInt16", 65535.0, false}}) {
    SCOPED_TRACE(type);
    RasterFixture fixture{.type = type};
    fixture.void_value = declared;
    const auto source = open_fixture(file_in(folder, "a.tif"), fixture);
    EXPECT_EQ(!source->info().assumptions.empty(), is_told) << declared;
  }
}

TEST(HeightTally, MaskedPixelsAreNotJudged) {
  const TemporaryFolder folder;
  RasterFixture fixture{.width = 4, .height = 1, .type = "Int16"};
  fixture.value = [](int c, int) { return c == 1 ? -32768.0 : 100.0 + c; };
  fixture.mask = {255, 0, 255, 255};
  const std::string path = file_in(folder, "a.tif");
  write_raster(path, fixture);
  for (const Through through : {Through::kCache, Through::kGdal}) {
    EXPECT_EQ(read_with(path, {}, HeightGuard::kStop, through).advice(), "");
  }
}

}  // namespace
}  // namespace qmpipe::testing::tally_test
