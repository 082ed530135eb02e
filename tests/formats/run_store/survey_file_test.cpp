// A survey's file gives back what was written, and nothing else.
#include "formats/run_store/survey_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>
#include <random>
#include <set>

#include "formats/bytes/file_bytes.h"
#include "formats/bytes/seal.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::survey_file_test {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

const TilingScheme kGeodetic(Projection::kGeodetic);
constexpr std::int32_t kZoom = 7;

SurveyedZoom random_survey(std::mt19937& random, std::size_t most) {
  SurveyedZoom surveyed;
  std::uniform_real_distribution<float> height_m(-11000, 9000);
  std::set<TileKey> keys;
  const std::size_t count = random() % (most + 1);
  while (keys.size() < count) {
    keys.insert({.zoom = kZoom,
                 .x = static_cast<std::int32_t>(random() % 256),
                 .y = static_cast<std::int32_t>(random() % 128)});
  }
  for (const TileKey& key : keys) {
    const float a = height_m(random);
    const float b = height_m(random);
    surveyed.tiles.push_back({.key = key,
                              .lowest_m = std::min(a, b),
                              .highest_m = std::max(a, b),
                              .valid_posts = static_cast<std::int32_t>(random() % 66049 + 1),
                              .rim_m = random() % 2 == 0 ? 0 : std::abs(a)});
  }
  if (random() % 2 == 0) surveyed.pole_heights_m[0] = height_m(random);
  if (random() % 2 == 0) surveyed.pole_heights_m[1] = height_m(random);
  return surveyed;
}

class SurveyFile : public ::testing::Test {
 protected:
  std::filesystem::path path() const { return survey_file_path(folder_.path(), kZoom); }
  std::string refusal(const std::vector<std::uint8_t>& bytes) const {
    write_file_atomically(path(), bytes);
    const auto read = read_survey_file(path(), kZoom, kGeodetic);
    return read ? "" : read.error().message;
  }
  std::vector<std::uint8_t> written(const SurveyedZoom& surveyed) const {
    write_survey_file(path(), kZoom, surveyed);
    return *read_file_bytes(path(), 1U << 20U);
  }
  TemporaryFolder folder_;
};

TEST_F(SurveyFile, GivesBackWhatWasWritten) {
  const auto seed = std::random_device()();
  SCOPED_TRACE("seed " + std::to_string(seed));
  std::mt19937 random(seed);
  for (int round = 0; round < 50; ++round) {
    const SurveyedZoom surveyed = random_survey(random, 200);
    write_survey_file(path(), kZoom, surveyed);
    const auto read = read_survey_file(path(), kZoom, kGeodetic);
    ASSERT_TRUE(read) << read.error().message;
    EXPECT_EQ(read->tiles, surveyed.tiles);
    EXPECT_EQ(read->pole_heights_m, surveyed.pole_heights_m);
  }
}

TEST_F(SurveyFile, AnyChangedOrMissingByteIsRefused) {
  std::mt19937 random(1);
  const std::vector<std::uint8_t> whole = written(random_survey(random, 12));
  for (std::size_t at = 0; at < whole.size(); ++at) {
    std::vector<std::uint8_t> damaged = whole;
    damaged[at] ^= static_cast<std::uint8_t>(1U << (random() % 8));
    EXPECT_THAT(refusal(damaged), HasSubstr("survey-07.qms")) << at;
    damaged.resize(at);
    EXPECT_THAT(refusal(damaged), HasSubstr("survey-07.qms")) << at;
  }
}

TEST_F(SurveyFile, AnotherZoomsSurveyIsRefused) {
  std::mt19937 random(2);
  written(random_survey(random, 12));
  const auto read = read_survey_file(path(), kZoom - 1, kGeodetic);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("another zoom's survey"));
}

TEST_F(SurveyFile, TilesThatCannotBeAreRefusedByName) {
  const SurveyedTile good = {
      .key = {kZoom, 3, 4}, .lowest_m = -1, .highest_m = 2, .valid_posts = 9};
  const auto refusal_of = [this](std::vector<SurveyedTile> tiles) {
    return refusal(written({.tiles = std::move(tiles), .pole_heights_m = {}}));
  };
  EXPECT_EQ(refusal_of({good}), "");
  EXPECT_THAT(refusal_of({good, good}), HasSubstr("tile 7/3/4 is out of order"));
  SurveyedTile bad = good;
  bad.key.x = 256;
  EXPECT_THAT(refusal_of({bad}), HasSubstr("tile 7/256/4 lies outside"));
  bad = good;
  bad.highest_m = -2;
  EXPECT_THAT(refusal_of({bad}), HasSubstr("range of heights"));
  bad.highest_m = std::numeric_limits<float>::quiet_NaN();
  EXPECT_THAT(refusal_of({bad}), HasSubstr("range of heights"));
  bad = good;
  bad.valid_posts = 0;
  EXPECT_THAT(refusal_of({bad}), HasSubstr("valid posts"));
}

TEST_F(SurveyFile, AMissingFileIsNamed) {
  const auto read = read_survey_file(path(), kZoom, kGeodetic);
  ASSERT_FALSE(read);
  EXPECT_THAT(read.error().message, HasSubstr("survey-07.qms"));
}

}  // namespace
}  // namespace qmpipe::survey_file_test
