// Segments of borders that are damaged, cut off, foreign or missing.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <span>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/little_endian.h"
#include "formats/bytes/seal.h"
#include "formats/run_store/hdf5_border_store.h"
#include "tests/support/random_borders.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::hdf5_border_damage_test {
namespace {

namespace fs = std::filesystem;
using testing::border_of_number;
using testing::border_segment_path;
using testing::BorderModel;
using testing::bytes_of;
using testing::error_of_opening;
using ::testing::HasSubstr;
using testing::make_segment;
using testing::mask_of_seed;
using testing::open_borders;
using testing::publish;
using testing::publish_some;
using testing::take;
using testing::TemporaryFolder;

constexpr Hdf5BorderOptions kOptions = {.max_zoom = 5};
const TilingScheme kGeodetic{Projection::kGeodetic};

TEST(Hdf5BorderDamage, RefusesASegmentCutOffAnywhere) {
  const TemporaryFolder folder;
  make_segment(folder.path(), 600);
  const fs::path path = border_segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  std::mt19937_64 random(21);
  for (std::size_t k = 0; k < 400; ++k) {
    const std::size_t bytes = k < 200 ? whole.size() - 1 - k : random() % whole.size();
    write_file_atomically(path, std::span(whole).first(bytes));
    ASSERT_THAT(error_of_opening(folder.path()), HasSubstr(path.string()))
        << bytes << " of " << whole.size() << " bytes, seed 21";
  }
  std::vector<std::uint8_t> longer = whole;
  longer.push_back(0);
  write_file_atomically(path, longer);
  EXPECT_THAT(error_of_opening(folder.path()), HasSubstr("remove the run folder"));
}

// Either the store does not open, or taking throws for the borders of a chunk; whatever is taken is
// right.
void expect_damage_is_noticed(const fs::path& folder, const BorderModel& model) {
  const std::string path = border_segment_path(folder, 0).string();
  auto store = open_hdf5_border_store(folder, kGeodetic, kOptions);
  if (!store) {
    ASSERT_THAT(store.error().message, HasSubstr(path));
    ASSERT_THAT(store.error().message, HasSubstr("remove the run folder"));
    return;
  }
  int noticed = 0;
  for (const auto& [n, mask] : model) {
    try {
      ASSERT_EQ(take(**store, n), mask);
    } catch (const IoError& error) {
      ++noticed;
      ASSERT_EQ(error.path(), path);
      ASSERT_THAT(error.what(), HasSubstr("build with --overwrite"));
    }
  }
  ASSERT_GT(noticed, 0);
}

TEST(Hdf5BorderDamage, NoticesFlippedBitsEverywhere) {
  const TemporaryFolder folder;
  const BorderModel model = make_segment(folder.path(), 9);
  const fs::path path = border_segment_path(folder.path(), 0);
  std::vector<std::uint8_t> damaged = bytes_of(path);
  std::mt19937_64 random(31);
  for (std::size_t at = 0; at < damaged.size(); at += 1 + random() % 8) {
    const auto mask = static_cast<std::uint8_t>(1U << (random() % 8));
    SCOPED_TRACE("byte " + std::to_string(at) + ", mask " + std::to_string(mask) + ", seed 31");
    damaged[at] ^= mask;
    write_file_atomically(path, damaged);
    expect_damage_is_noticed(folder.path(), model);
    if (HasFatalFailure()) return;
    damaged[at] ^= mask;
  }
}

TEST(Hdf5BorderDamage, LosesOnlyTheChunkThatIsDamaged) {
  const TemporaryFolder folder;
  const BorderModel model = make_segment(folder.path(), 1200);
  const fs::path path = border_segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  std::mt19937_64 random(41);
  for (int k = 0; k < 100; ++k) {
    const std::size_t at = random() % whole.size();
    SCOPED_TRACE("byte " + std::to_string(at) + ", seed 41");
    std::vector<std::uint8_t> damaged = whole;
    damaged[at] ^= 0x55U;
    write_file_atomically(path, damaged);
    expect_damage_is_noticed(folder.path(), model);
    if (HasFatalFailure()) return;
  }
}

TEST(Hdf5BorderDamage, RefusesAnotherSchemeAndZoomsDeeperThanTheRun) {
  const TemporaryFolder folder;
  make_segment(folder.path(), 20);
  EXPECT_THAT(error_of_opening(folder.path(), Projection::kMercator),
              HasSubstr("its tiling scheme is geodetic, the run's is mercator"));
  EXPECT_THAT(error_of_opening(folder.path(), Projection::kGeodetic, 4),
              HasSubstr("its border 5/0/0 side 0 lies outside"));
}

TEST(Hdf5BorderDamage, NamesASegmentThatIsMissing) {
  const TemporaryFolder folder;
  {
    const auto store = open_borders(folder.path(), kOptions);
    for (std::int32_t n = 0; n < 3; ++n) {
      publish(*store, n, mask_of_seed(1));
      store->seal();
    }
  }
  fs::remove(border_segment_path(folder.path(), 1));
  EXPECT_THAT(error_of_opening(folder.path()), HasSubstr("borders-000001.h5: the file is missing"));
}

// Changes a byte and seals the file again, so that no hash gives it away.
void reseal(const fs::path& path, const std::vector<std::uint8_t>& whole, std::size_t at,
            std::uint8_t value) {
  std::vector<std::uint8_t> body = whole;
  body.resize(load_little_endian<std::uint64_t>(std::span(whole).last(32).data()));
  body.at(at) = value;
  append_seal(body, {});
  write_file_atomically(path, body);
}

TEST(Hdf5BorderDamage, RefusesSealedFilesThatAreNoSegments) {
  const TemporaryFolder folder;
  make_segment(folder.path(), 9);
  const fs::path path = border_segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  for (const std::string name :
       {"borders", "chunk_first", "chunk_last", "content_hash", "format_version", "scheme"}) {
    const auto at = std::search(whole.begin(), whole.end(), name.begin(), name.end());
    ASSERT_NE(at, whole.end()) << name;
    reseal(path, whole, static_cast<std::size_t>(at - whole.begin()), 'x');
    EXPECT_THAT(error_of_opening(folder.path()), HasSubstr(path.string())) << name;
  }
  std::vector<std::uint8_t> text = {'n', 'o', ' ', 'H', 'D', 'F', '5'};
  append_seal(text, {});
  write_file_atomically(path, text);
  EXPECT_THAT(error_of_opening(folder.path()), HasSubstr("it is no HDF5 file of the kind"));
}

// A file whose seal is right, whatever it says: only our own mistakes would make it.
TEST(Hdf5BorderDamage, NeverTrustsTheIndexOfASealedFile) {
  const TemporaryFolder folder;
  constexpr std::int32_t kFirst = 256 * 3 + 4 * 7 + 2;
  ASSERT_EQ(border_of_number(kFirst),
            (BorderKey{.owner = {.zoom = 5, .x = 7, .y = 3}, .side = Side::kEast}));
  BorderModel model;
  {
    const auto store = open_borders(folder.path(), kOptions);
    publish_some(*store, model, kFirst, kFirst + 3);
    store->seal();
  }
  const fs::path path = border_segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  const std::vector<std::uint8_t> key = {5, 0, 0, 0, 7, 0, 0, 0, 3, 0, 0, 0, 2, 0, 0, 0};
  const auto first = std::search(whole.begin(), whole.end(), key.begin(), key.end());
  ASSERT_NE(first, whole.end());
  const auto at = static_cast<std::size_t>(first - whole.begin());
  for (const auto& [offset, value] : std::map<std::size_t, std::uint8_t>{
           {0, 6}, {3, 0x80}, {4, 64}, {8, 32}, {12, 4}, {15, 128}}) {
    reseal(path, whole, at + offset, value);
    EXPECT_THAT(error_of_opening(folder.path()), HasSubstr("lies outside")) << offset;
  }
  reseal(path, whole, at + 8, 9);
  EXPECT_THAT(error_of_opening(folder.path()), HasSubstr("out of order"));
  // A key that could be: the chunk says otherwise.
  reseal(path, whole, at + 12, 1);
  const auto store = open_borders(folder.path(), kOptions);
  EXPECT_THROW(take(*store, model.rbegin()->first), IoError);
}

}  // namespace
}  // namespace qmpipe::hdf5_border_damage_test
