#include "formats/detail_model/file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hdf5.h>

#include <span>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file_layout.h"
#include "stages/detail_model/block.h"
#include "tests/support/detail_fixture.h"
#include "tests/support/random_detail_model.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::file_test {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using testing::random_detail_block;
using testing::random_detail_model;
using testing::TemporaryFolder;

constexpr std::size_t kAnySize = std::size_t{1} << 30U;

std::vector<std::uint8_t> bytes_of(const fs::path& path) {
  const auto bytes = read_file_bytes(path, kAnySize);
  EXPECT_TRUE(bytes.ok());
  return *bytes;
}

std::string error_of_reading(const fs::path& path) {
  const auto model = read_detail_file(path);
  return model.ok() ? "" : model.error().message;
}

DetailModel small_model() {
  std::mt19937_64 random(5);
  DetailModel model;
  model.crs_wkt = "LOCAL_CS[\"none\"]";
  model.interval = 10;
  model.blocks = {random_detail_block(random, 12, 14, 20), random_detail_block(random, 9, 8, 0)};
  model.seams = {{{{0, 3}, {1, 8}, {0, 4}}}, {{{1, 0}, {0, 11}, {1, 1}}}};
  return model;
}

TEST(DetailFile, GivesBackWhatWasWritten) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  for (std::uint64_t seed = 0; seed < 40; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const DetailModel model = random_detail_model(random, seed < 20 ? 8 : 500);
    write_detail_file(path, model);
    const auto back = read_detail_file(path);
    ASSERT_TRUE(back.ok()) << back.error().message;
    ASSERT_EQ(*back, model);
    const auto summary = read_detail_summary(path);
    ASSERT_TRUE(summary.ok()) << summary.error().message;
    ASSERT_EQ(*summary, summary_of(model));
  }
}

TEST(DetailFile, GivesBackAnEmptyBlockAndArraysOfSeveralChunks) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  std::mt19937_64 random(11);
  DetailModel model;
  model.blocks = {{.points = {}, .coarse_triangles = {}, .splits = {}, .svo_m = {0}},
                  random_detail_block(random, kMaxChunkWords - 1, 70000, 1),
                  random_detail_block(random, 3, 1, kMaxChunkWords)};
  write_detail_file(path, model);
  const auto back = read_detail_file(path);
  ASSERT_TRUE(back.ok()) << back.error().message;
  EXPECT_EQ(*back, model);
}

TEST(DetailFile, SameModelSameBytesAndAnOlderFileIsReplaced) {
  const TemporaryFolder folder;
  write_detail_file(folder.path() / "a.h5", small_model());
  write_file_atomically(folder.path() / "b.h5", std::vector<std::uint8_t>{1, 2, 3});
  write_detail_file(folder.path() / "b.h5", small_model());
  EXPECT_EQ(bytes_of(folder.path() / "a.h5"), bytes_of(folder.path() / "b.h5"));
}

// Table 1 of the paper: 8 bytes of fields, 16 for each of two triangles deleted, 28 for each
// replaced.
TEST(DetailFile, TakesATenthOfTheRawIncrementsOfARealBlock) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  const testing::DetailMesh mesh = testing::hilly_mesh(130, 130, 3);
  const auto target = static_cast<std::int64_t>(mesh.triangles.size() / 15);
  DetailModel model;
  model.blocks = {make_detail_block(mesh.points, mesh.triangles,
                                    simplify_by_quadrics(mesh.points, mesh.triangles, {}, target))
                      .block};
  write_detail_file(path, model);
  const auto back = read_detail_file(path);
  ASSERT_TRUE(back.ok()) << back.error().message;
  ASSERT_EQ(*back, model);
  std::size_t raw_bytes = 0;
  for (const DetailSplit& split : model.blocks[0].splits) raw_bytes += 40 + 28 * split.fan;
  EXPECT_LT(10 * fs::file_size(path), raw_bytes);
}

TEST(DetailFile, RefusesAFileCutOffAnywhere) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  write_detail_file(path, small_model());
  const std::vector<std::uint8_t> whole = bytes_of(path);
  std::mt19937_64 random(21);
  for (std::size_t k = 0; k < 400; ++k) {
    const std::size_t bytes = k < 200 ? whole.size() - 1 - k : random() % whole.size();
    write_file_atomically(path, std::span(whole).first(bytes));
    ASSERT_THAT(error_of_reading(path), HasSubstr(path.string())) << bytes << " bytes, seed 21";
  }
}

TEST(DetailFile, RefusesFlippedBitsEverywhere) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  write_detail_file(path, small_model());
  std::vector<std::uint8_t> damaged = bytes_of(path);
  std::mt19937_64 random(31);
  for (int k = 0; k < 1000; ++k) {
    const std::size_t at = random() % damaged.size();
    const auto mask = static_cast<std::uint8_t>(1U << (random() % 8));
    damaged[at] ^= mask;
    write_file_atomically(path, damaged);
    ASSERT_THAT(error_of_reading(path), HasSubstr("build the model again"))
        << "byte " << at << ", seed 31";
    ASSERT_FALSE(read_detail_summary(path).ok());
    damaged[at] ^= mask;
  }
}

// The bytes of an array in a file of small_model().
ByteRange range_of(const fs::path& path, const char* name) {
  const auto file = Hdf5SegmentReader::open(path, detail_identity());
  EXPECT_TRUE(file.ok());
  const auto data = file->chunked(name, 1, kAnySize);
  EXPECT_TRUE(data.ok());
  return data->chunks.at(0).range;
}

// Behind a seal that is right, a chunk may say anything.
TEST(DetailFile, TrustsNoBytesBehindTheSeal) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  write_detail_file(path, small_model());
  const std::vector<std::uint8_t> whole = bytes_of(path);
  const auto body = without_seal(whole);
  std::mt19937_64 random(41);
  int refused = 0;
  for (const char* name : kDetailArrayNames) {
    write_file_atomically(path, whole);
    const ByteRange range = range_of(path, name);
    for (int k = 0; k < 60; ++k) {
      std::vector<std::uint8_t> damaged(body.begin(), body.end());
      damaged[range.offset + random() % range.bytes] ^=
          static_cast<std::uint8_t>(1U << (random() % 8));
      append_seal(damaged, {});
      write_file_atomically(path, damaged);
      const auto model = read_detail_file(path);
      if (model.ok()) {
        const auto again = decode_detail(summary_of(*model), encode_detail(*model));
        ASSERT_TRUE(again.ok()) << name << ", seed 41";
        ASSERT_EQ(*again, *model) << name << ", seed 41";
      } else {
        ++refused;
        ASSERT_THAT(model.error().message, HasSubstr(path.string())) << name << ", seed 41";
      }
    }
  }
  EXPECT_GT(refused, 100);
}

// A file as the writer would make it, of numbers that need not fit each other.
struct Forged {
  std::vector<double> frame = {0, 0, 0, 1, 1, 1};
  std::vector<std::uint64_t> interval = {10};
  std::vector<std::uint64_t> seams = {2};
  std::vector<std::uint64_t> blocks = {12, 14, 20, 9, 8, 0};
  DetailArrays arrays = encode_detail(small_model());
};

std::string error_of(const Forged& forged) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "forged.h5";
  Hdf5SegmentWriter file(path, detail_identity());
  file.write_values(kDetailFrame, 3, forged.frame);
  file.write_values(kDetailInterval, 1, forged.interval);
  file.write_values(kDetailSeams, 1, forged.seams);
  file.write_values(kDetailBlocks, 3, forged.blocks);
  for (std::size_t k = 0; k < kDetailArrayCount; ++k) {
    const std::vector<std::uint32_t>& words = forged.arrays[k];
    if (words.empty()) continue;
    file.create_chunked(kDetailArrayNames[k], H5T_STD_U32LE, {words.size()}, {words.size()},
                        H5T_NATIVE_UINT32, nullptr);
    file.write_chunk(0, pack_words(words, words.size(), 1));
  }
  write_file_atomically(path, file.finish_whole(0));
  const std::string error = error_of_reading(path);
  EXPECT_TRUE(error.empty() || error.find(path.string()) != std::string::npos) << error;
  return error;
}

TEST(DetailFile, RefusesASealedFileWhoseNumbersDoNotFit) {
  ASSERT_EQ(error_of({}), "");
  EXPECT_THAT(error_of({.frame = {0, 0, 0, 1, 0, 1}}), HasSubstr("a step of 0 m"));
  EXPECT_THAT(error_of({.frame = {0, 0, 0 / 0.0, 1, 1, 1}}), HasSubstr("offset is not finite"));
  EXPECT_THAT(error_of({.frame = {0, 0, 0}}), HasSubstr("`frame` has another shape"));
  EXPECT_THAT(error_of({.interval = {0}}), HasSubstr("interval is 0"));
  EXPECT_THAT(error_of({.interval = {1, 2}}), HasSubstr("`interval` has another shape"));
  EXPECT_THAT(error_of({.interval = {1ULL << 32U}}), HasSubstr("interval is 4294967296"));
  EXPECT_THAT(error_of({.seams = {3}}), HasSubstr("`seam_block` has another shape"));
  EXPECT_THAT(error_of({.seams = {~0ULL}}), HasSubstr("can be numbered"));
  EXPECT_THAT(error_of({.blocks = {12, 14, 21, 9, 8, 0}}), HasSubstr("another shape"));
  EXPECT_THAT(error_of({.blocks = {12, 14, 20}}), HasSubstr("another shape"));
  EXPECT_THAT(error_of({.blocks = {~0ULL, 14, 20, 54, 8, 0}}), HasSubstr("can be numbered"));
  EXPECT_THAT(error_of({.blocks = {12, 14, 4'000'000'000, 9, 8, 0}}), HasSubstr("be numbered"));
  // The sums are right, the blocks are not.
  EXPECT_THAT(error_of({.blocks = {1, 14, 20, 20, 8, 0}}), HasSubstr("block 0: the coarsest mesh"));
}

TEST(DetailFile, RefusesASealedFileWhoseIndicesDoNotExist) {
  const auto error_with = [](DetailArray array, std::size_t at, std::uint32_t word) {
    Forged forged;
    forged.arrays[index_of(array)].at(at) = word;
    return error_of(forged);
  };
  EXPECT_THAT(error_with(DetailArray::kCornerB, 0, 24), HasSubstr("names point 12 of 12"));
  EXPECT_THAT(error_with(DetailArray::kCornerB, 0, 1), HasSubstr("names point 4294967295"));
  EXPECT_THAT(error_with(DetailArray::kHalfEdge, 0, 42), HasSubstr("split 0 names half-edge 42"));
  EXPECT_EQ(error_with(DetailArray::kHalfEdge, 0, 41), "");
  EXPECT_THAT(error_with(DetailArray::kFan, 3, 0), HasSubstr("split 3 names half-edge"));
  EXPECT_THAT(error_with(DetailArray::kFan, 3, 21), HasSubstr("a fan of 21, of 20 triangles"));
  EXPECT_THAT(error_with(DetailArray::kSvo, 0, 0x7F800000), HasSubstr("of level 0 is inf m"));
  EXPECT_THAT(error_with(DetailArray::kSvo, 0, 0x80000000), HasSubstr("of level 0 is -0 m"));
  EXPECT_THAT(error_with(DetailArray::kSvo, 5, 0xFFFFFFFF), HasSubstr("of level 5"));
  EXPECT_THAT(error_with(DetailArray::kPointX, 0, 1), HasSubstr("point 0 lies at -1"));
  EXPECT_THAT(error_with(DetailArray::kPointY, 0, 0x80000000), HasSubstr("outside the grid"));
  EXPECT_THAT(error_with(DetailArray::kSeamBlock, 4, 2), HasSubstr("seam 1 names block 2 of 2"));
  EXPECT_THAT(error_with(DetailArray::kSeamPoint, 0, 24), HasSubstr("seam 0 names point 12"));
  Forged missing;
  missing.arrays[index_of(DetailArray::kFan)].clear();
  EXPECT_THAT(error_of(missing), HasSubstr("`fan` cannot be read"));
}

TEST(DetailFile, NamesWhatElseAFileIs) {
  const TemporaryFolder folder;
  const fs::path path = folder.path() / "model.h5";
  const auto error_of_writing = [&](const SegmentIdentity& identity) {
    write_file_atomically(path, Hdf5SegmentWriter(path, identity).finish_whole(0));
    return error_of_reading(path);
  };
  SegmentIdentity identity = detail_identity();
  identity.format_version = 2;
  EXPECT_THAT(error_of_writing(identity), HasSubstr("format version is 2, this program reads 1"));
  identity.value = "something else";
  EXPECT_THAT(error_of_writing(identity), HasSubstr("its format is something else"));
  EXPECT_THAT(error_of_writing(store_identity(1, TilingScheme(Projection::kGeodetic))),
              HasSubstr("it names no format"));
  EXPECT_THAT(error_of_writing(detail_identity()), HasSubstr("`frame` cannot be read"));

  write_detail_file(path, small_model());
  const std::vector<std::uint8_t> whole = bytes_of(path);
  write_file_atomically(path, without_seal(whole));
  EXPECT_THAT(error_of_reading(path), HasSubstr("none of qmpipe's"));
  EXPECT_THAT(error_of_reading(folder.path()), HasSubstr(folder.path().string()));
  EXPECT_THAT(error_of_reading(folder.path() / "none.h5"), HasSubstr("No such file"));
}

TEST(DetailFile, ThrowsWhenItCannotBeWritten) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_detail_file(folder.path() / "no" / "model.h5", small_model()), IoError);
  DetailModel model = small_model();
  model.crs_wkt = std::string(70000, 'x');
  EXPECT_THROW(write_detail_file(folder.path() / "model.h5", model), IoError);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(DetailArrays, DecodeToAModelWithoutFaultOrNone) {
  int refused = 0;
  for (std::uint64_t seed = 0; seed < 3000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const DetailModel model = random_detail_model(random, 12);
    DetailArrays arrays = encode_detail(model);
    std::vector<std::uint32_t>& array = arrays[random() % kDetailArrayCount];
    if (array.empty()) continue;
    array[random() % array.size()] ^= 1U << (random() % 32);
    const auto back = decode_detail(summary_of(model), arrays);
    if (!back) {
      ++refused;
      continue;
    }
    ASSERT_NE(*back, model);
    ASSERT_EQ(encode_detail(*back), arrays);
  }
  EXPECT_GT(refused, 500);
}

}  // namespace
}  // namespace qmpipe::file_test
