// The lattice store on disk: crashes, damage, full disks, and other readers.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <fstream>
#include <string>
#include <thread>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/little_endian.h"
#include "formats/bytes/seal.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "tests/support/lattice_blocks.h"
#include "tests/support/program_output.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::hdf5_lattice_store_test {
namespace {

namespace fs = std::filesystem;
using testing::block_of_seed;
using testing::BlockModel;
using ::testing::HasSubstr;
using testing::output_of;
using testing::SmallDisk;
using testing::TemporaryFolder;

fs::path segment_path(const fs::path& folder, std::int32_t number) {
  return qmpipe::segment_path(folder, SegmentKind::kLattice, number);
}

const TilingScheme kGeodetic{Projection::kGeodetic};
const TilingScheme kMercator{Projection::kMercator};
constexpr Hdf5LatticeOptions kOptions = {.max_zoom = 4};
const std::vector<float> kVoidBlock(kBlockSize, testing::kVoidHeight);

std::unique_ptr<LatticeStore> open(const fs::path& folder, const Hdf5LatticeOptions& options) {
  auto store = open_hdf5_lattice_store(folder, kGeodetic, options);
  if (!store) throw std::runtime_error(store.error().message);
  return std::move(*store);
}

std::string error_of_opening(const fs::path& folder, const TilingScheme& scheme,
                             const Hdf5LatticeOptions& options) {
  const auto store = open_hdf5_lattice_store(folder, scheme, options);
  return store ? "" : store.error().message;
}

TileKey key_of(std::int32_t n) { return {.zoom = 4, .x = n % 32, .y = n / 32}; }

void put(LatticeStore& store, BlockModel& model, std::int32_t n, const std::vector<float>& block) {
  const TileKey key = key_of(n);
  store.put_block(key, block);
  model.put(key, block);
}

void put_some(LatticeStore& store, BlockModel& model, std::int32_t first, std::int32_t end) {
  for (std::int32_t n = first; n < end; ++n) {
    put(store, model, n, block_of_seed(static_cast<std::uint64_t>(n)));
  }
}

std::vector<std::uint8_t> bytes_of(const fs::path& path) {
  return read_file_bytes(path, std::size_t{1} << 30U).value();
}

void write_bytes(const fs::path& path, std::span<const std::uint8_t> bytes) {
  write_file_atomically(path, bytes);
}

// A sealed folder with one small segment of flat and smooth blocks, one of them void.
BlockModel make_small_segment(const fs::path& folder) {
  BlockModel model;
  const auto store = open(folder, kOptions);
  for (const std::int32_t n : {0, 3, 4, 6, 7, 9}) {
    put(*store, model, n, block_of_seed(static_cast<std::uint64_t>(n)));
  }
  put(*store, model, 3, kVoidBlock);
  store->seal();
  return model;
}

TEST(Hdf5LatticeStore, IsTheSameWhenOpenedAgain) {
  const TemporaryFolder folder;
  BlockModel model;
  std::mt19937_64 random(11);
  for (int round = 0; round < 4; ++round) {
    const auto store = open(folder.path(), {.max_zoom = 4, .segment_bytes = 500'000});
    EXPECT_EQ(model.differences(*store, kGeodetic), 0U) << "round " << round << ", seed 11";
    for (int k = 0; k < 25; ++k) {
      const auto n = static_cast<std::int32_t>(random() % 40);
      put(*store, model, n, random() % 4 == 0 ? kVoidBlock : block_of_seed(random()));
    }
    store->seal();
  }
  EXPECT_GT(count_lattice_segments(folder.path()), 4);
  EXPECT_EQ(model.differences(*open(folder.path(), kOptions), kGeodetic), 0U);
}

TEST(Hdf5LatticeStore, OnlyWhatWasSealedOutlivesACrash) {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    BlockModel ignored;
    const auto store = open(folder.path(), kOptions);
    put_some(*store, ignored, 0, 5);
    store->seal();
    put_some(*store, ignored, 3, 8);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  // What a write that was killed leaves behind.
  const fs::path torn = segment_path(folder.path(), 1).string() + kTemporarySuffix;
  write_bytes(torn, std::vector<std::uint8_t>(1000, 7));
  BlockModel model;
  for (std::int32_t n = 0; n < 8; ++n) {
    model.put(key_of(n), n < 5 ? block_of_seed(static_cast<std::uint64_t>(n)) : kVoidBlock);
  }
  const auto store = open(folder.path(), kOptions);
  EXPECT_EQ(model.differences(*store, kGeodetic), 0U);
  EXPECT_FALSE(fs::exists(torn));
}

TEST(Hdf5LatticeStore, RefusesASegmentCutOffAnywhere) {
  const TemporaryFolder folder;
  make_small_segment(folder.path());
  const fs::path path = segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  std::mt19937_64 random(21);
  for (std::size_t k = 0; k < 400; ++k) {
    const std::size_t bytes = k < 200 ? whole.size() - 1 - k : random() % whole.size();
    write_bytes(path, std::span(whole).first(bytes));
    ASSERT_THAT(error_of_opening(folder.path(), kGeodetic, kOptions), HasSubstr(path.string()))
        << bytes << " of " << whole.size() << " bytes, seed 21";
  }
  std::vector<std::uint8_t> longer = whole;
  longer.push_back(0);
  write_bytes(path, longer);
  EXPECT_THAT(error_of_opening(folder.path(), kGeodetic, kOptions), HasSubstr(path.string()));
}

// Either the store does not open, or reading throws for some block; whatever is read is right.
void expect_damage_is_noticed(const fs::path& folder, const BlockModel& model) {
  const std::string path = segment_path(folder, 0).string();
  auto store = open_hdf5_lattice_store(folder, kGeodetic, kOptions);
  if (!store) {
    ASSERT_THAT(store.error().message, HasSubstr(path));
    return;
  }
  int noticed = 0;
  for (const auto& [key, heights_m] : model.blocks()) {
    try {
      ASSERT_EQ(model.differences(**store, Lattice(kGeodetic, key.zoom), posts_of(key)), 0U);
    } catch (const IoError& error) {
      ++noticed;
      ASSERT_EQ(error.path(), path);
      ASSERT_THAT(error.what(), HasSubstr(to_string(key)));
    }
  }
  ASSERT_EQ(noticed, 1);
}

TEST(Hdf5LatticeStore, NoticesEveryFlippedBit) {
  const TemporaryFolder folder;
  const BlockModel model = make_small_segment(folder.path());
  const fs::path path = segment_path(folder.path(), 0);
  const std::vector<std::uint8_t> whole = bytes_of(path);
  std::mt19937_64 random(31);
  for (int k = 0; k < 500; ++k) {
    const std::size_t at = random() % whole.size();
    const auto bit = static_cast<std::uint8_t>(1U << (random() % 8));
    SCOPED_TRACE("byte " + std::to_string(at) + ", mask " + std::to_string(bit) + ", seed 31");
    std::vector<std::uint8_t> damaged = whole;
    damaged[at] ^= bit;
    write_bytes(path, damaged);
    expect_damage_is_noticed(folder.path(), model);
    if (HasFatalFailure()) return;
  }
}

TEST(Hdf5LatticeStore, RefusesAnotherSchemeAndBlocksDeeperThanTheRun) {
  const TemporaryFolder folder;
  make_small_segment(folder.path());
  EXPECT_THAT(error_of_opening(folder.path(), kMercator, kOptions),
              HasSubstr("its tiling scheme is geodetic, the run's is mercator"));
  EXPECT_THAT(error_of_opening(folder.path(), kGeodetic, {.max_zoom = 3}),
              HasSubstr("its block 4/0/0 lies outside"));
}

TEST(Hdf5LatticeStore, RefusesSealedFilesThatAreNoSegments) {
  const TemporaryFolder folder;
  make_small_segment(folder.path());
  const fs::path path = segment_path(folder.path(), 0);
  std::vector<std::uint8_t> body = bytes_of(path);
  body.resize(load_little_endian<std::uint64_t>(body.data() + body.size() - 32));
  for (const std::string name :
       {"blocks", "keys", "is_void", "content_hash", "format_version", "scheme"}) {
    std::vector<std::uint8_t> other = body;
    auto at = std::search(other.begin(), other.end(), name.begin(), name.end());
    ASSERT_NE(at, other.end());
    *at = 'x';
    append_seal(other, {});
    write_bytes(path, other);
    EXPECT_THAT(error_of_opening(folder.path(), kGeodetic, kOptions), HasSubstr(path.string()))
        << name;
  }
  std::vector<std::uint8_t> text = {'n', 'o', ' ', 'H', 'D', 'F', '5'};
  append_seal(text, {});
  write_bytes(path, text);
  EXPECT_THAT(error_of_opening(folder.path(), kGeodetic, kOptions),
              HasSubstr("it is no HDF5 file of the kind"));
}

TEST(Hdf5LatticeStore, NamesASegmentThatIsMissing) {
  const TemporaryFolder folder;
  BlockModel model;
  {
    const auto store = open(folder.path(), kOptions);
    for (std::int32_t n = 0; n < 3; ++n) {
      put_some(*store, model, n, n + 1);
      store->seal();
    }
  }
  fs::remove(segment_path(folder.path(), 1));
  EXPECT_THAT(error_of_opening(folder.path(), kGeodetic, kOptions),
              HasSubstr("lattice-000001.h5: the file is missing"));
}

TEST(Hdf5LatticeStore, SaysSoWhenTheFolderGoesAwayUnderIt) {
  const TemporaryFolder folder;
  const fs::path run = folder.path() / "run";
  BlockModel model;
  const auto store = open(run, kOptions);
  put_some(*store, model, 0, 3);
  store->seal();
  fs::remove_all(run);
  EXPECT_THROW(static_cast<void>(model.differences(*store, kGeodetic)), IoError);
  put_some(*store, model, 3, 6);
  EXPECT_THROW(store->seal(), IoError);
}

TEST(Hdf5LatticeStore, LosesNothingOnAFullDisk) {
  const TemporaryFolder folder;
  const SmallDisk disk(folder.path());
  if (!disk.is_mounted()) GTEST_SKIP() << "needs the right to mount a tmpfs (root)";
  write_bytes(folder.path() / "filler", std::vector<std::uint8_t>(1'200'000, 1));
  BlockModel model;
  {
    const auto store = open(folder.path() / "run", {.max_zoom = 4, .segment_bytes = 400'000});
    std::string message;
    for (std::int32_t n = 0; n < 8 && message.empty(); ++n) {
      try {
        put(*store, model, n, block_of_seed(static_cast<std::uint64_t>(3 * n + 2)));
      } catch (const IoError& error) {
        message = error.what();
        model.put(key_of(n), block_of_seed(static_cast<std::uint64_t>(3 * n + 2)));
      }
    }
    EXPECT_THAT(message, HasSubstr("lattice-00000"));
    EXPECT_THAT(message, HasSubstr("No space left on device"));
    EXPECT_THAT(message, HasSubstr("Free some space"));
    EXPECT_EQ(model.differences(*store, kGeodetic), 0U);
    fs::remove(folder.path() / "filler");
    store->seal();
  }
  EXPECT_EQ(model.differences(*open(folder.path() / "run", kOptions), kGeodetic), 0U);
}

TEST(Hdf5LatticeStore, KeepsMemoryWithinItsBounds) {
  constexpr std::int64_t kCache = 5 * 256 * 256 * 4;
  constexpr std::int64_t kSegment = 1'000'000;
  const TemporaryFolder folder;
  const auto store =
      open(folder.path(), {.max_zoom = 4, .segment_bytes = kSegment, .cache_bytes = kCache});
  BlockModel model;
  for (std::int32_t n = 0; n < 60; ++n) {
    put_some(*store, model, n, n + 1);
    ASSERT_LE(store->memory_bytes(), kSegment + 60 * 200);
  }
  store->seal();
  ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
  EXPECT_GE(store->memory_bytes(), kCache);
  EXPECT_LE(store->memory_bytes(), kCache + 60 * 200);
}

TEST(Hdf5LatticeStore, IsAnOrdinaryHdf5FileToOtherPrograms) {
  if (output_of("command -v h5dump").empty()) GTEST_SKIP() << "needs h5dump (hdf5-tools)";
  const TemporaryFolder folder;
  make_small_segment(folder.path());
  const std::string path = segment_path(folder.path(), 0).string();
  const std::string header = output_of("h5dump -H -p " + path);
  EXPECT_THAT(header, HasSubstr("FILTER_ID 32015"));
  EXPECT_THAT(header, HasSubstr("PREPROCESSING SHUFFLE"));
  EXPECT_THAT(header, HasSubstr("( 6, 256, 256 )"));
  EXPECT_THAT(header, HasSubstr("H5T_IEEE_F32LE"));
  EXPECT_THAT(output_of("h5dump -d is_void " + path), HasSubstr("(0): 0, 1, 0, 0, 0, 0"));
  EXPECT_THAT(output_of("h5dump -d keys " + path), HasSubstr("(1,0): 4, 3, 0"));
  EXPECT_THAT(output_of("h5dump -a scheme " + path), HasSubstr("\"geodetic\""));
}

// The library prints its errors thread by thread, unless told not to.
TEST(Hdf5LatticeStore, KeepsHdf5QuietOnEveryThread) {
  const TemporaryFolder folder;
  std::vector<std::uint8_t> text = {'n', 'o', ' ', 'H', 'D', 'F', '5'};
  append_seal(text, {});
  write_bytes(segment_path(folder.path(), 0), text);
  ::testing::internal::CaptureStderr();
  std::thread([&] {
    static_cast<void>(error_of_opening(folder.path(), kGeodetic, kOptions));
  }).join();
  EXPECT_EQ(::testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace qmpipe::hdf5_lattice_store_test
