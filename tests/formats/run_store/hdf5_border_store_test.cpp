// The border store on disk: runs that go on where another was killed, full disks, and other readers.
#include "formats/run_store/hdf5_border_store.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/program_output.h"
#include "tests/support/random_borders.h"
#include "tests/support/small_disk.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::hdf5_border_store_test {
namespace {

namespace fs = std::filesystem;
using testing::border_segment_path;
using testing::BorderModel;
using testing::bytes_of;
using testing::expect_all;
using testing::FileSizeLimit;
using ::testing::HasSubstr;
using testing::kBorderNumbers;
using testing::make_segment;
using testing::mask_of_seed;
using testing::open_borders;
using testing::output_of;
using testing::publish;
using testing::publish_some;
using testing::SmallDisk;
using testing::take;
using testing::TemporaryFolder;

constexpr Hdf5BorderOptions kOptions = {.max_zoom = 5};
const TilingScheme kGeodetic{Projection::kGeodetic};

TEST(Hdf5BorderStore, GivesALaterRunAllThatWasSealedTakenOrNot) {
  const TemporaryFolder folder;
  BorderModel sealed;
  std::mt19937_64 random(11);
  for (int run = 0; run < 6; ++run) {
    SCOPED_TRACE("run " + std::to_string(run) + ", seed 11");
    const auto store = open_borders(folder.path(), kOptions);
    EXPECT_EQ(store->size(), 0);
    BorderModel fresh;
    for (int part = 0; part < 3; ++part) {
      for (int k = 0; k < 700; ++k) {
        const auto n = static_cast<std::int32_t>(random() % kBorderNumbers);
        if (fresh.contains(n)) continue;
        publish(*store, n, fresh[n] = mask_of_seed(random()));
        if (random() % 2 == 0) {
          ASSERT_EQ(take(*store, n), fresh[n]);
        }
      }
      // The last part is lost, as when the run is killed.
      if (part == 2) break;
      store->seal();
      for (const auto& [n, mask] : fresh) sealed[n] = mask;
    }
    expect_all(*open_borders(folder.path(), kOptions), sealed);
    if (HasFatalFailure()) return;
  }
  EXPECT_EQ(count_border_segments(folder.path()), 12);
}

TEST(Hdf5BorderStore, TheNewestOfABorderCounts) {
  const TemporaryFolder folder;
  for (std::uint64_t run = 0; run < 3; ++run) {
    const auto store = open_borders(folder.path(), kOptions);
    if (run > 0) {
      EXPECT_EQ(take(*store, 9), mask_of_seed(100 + run - 1));
    }
    for (std::int32_t n = 5; n < 10; ++n) publish(*store, n, mask_of_seed(100 + run));
    EXPECT_EQ(store->size(), 5);
    EXPECT_EQ(take(*store, 5), mask_of_seed(100 + run)) << "before sealing";
    store->seal();
    EXPECT_EQ(take(*store, 6), mask_of_seed(100 + run)) << "after sealing";
    EXPECT_EQ(store->size(), 3);
  }
}

TEST(Hdf5BorderStore, BordersOfEarlierRunsDoNotCountAsWaiting) {
  const TemporaryFolder folder;
  const BorderModel model = make_segment(folder.path(), 20);
  const auto store = open_borders(folder.path(), kOptions);
  EXPECT_EQ(store->size(), 0);
  expect_all(*store, model);
  EXPECT_EQ(store->size(), 0);
}

TEST(Hdf5BorderStore, WritesNothingWhenThereIsNothingNew) {
  const TemporaryFolder folder;
  const auto store = open_borders(folder.path(), kOptions);
  store->seal();
  EXPECT_EQ(count_border_segments(folder.path()), 0);
  publish(*store, 1, mask_of_seed(1));
  store->seal();
  store->seal();
  EXPECT_EQ(count_border_segments(folder.path()), 1);
}

TEST(Hdf5BorderStore, TheOrderOfPublishingLeavesNoTrace) {
  const TemporaryFolder folder;
  std::vector<std::int32_t> numbers;
  for (std::int32_t n = 0; n < 4000; n += 3) numbers.push_back(n);
  std::mt19937_64 random(3);
  for (const std::string name : {"a", "b"}) {
    const auto store = open_borders(folder.path() / name, kOptions);
    std::shuffle(numbers.begin(), numbers.end(), random);
    for (const std::int32_t n : numbers) {
      publish(*store, n, mask_of_seed(static_cast<std::uint64_t>(n)));
      if (random() % 2 == 0) take(*store, n);
    }
    store->seal();
  }
  EXPECT_EQ(bytes_of(border_segment_path(folder.path() / "a", 0)),
            bytes_of(border_segment_path(folder.path() / "b", 0)))
      << "seed 3";
}

TEST(Hdf5BorderStore, SealingGivesItsMemoryBack) {
  constexpr std::int64_t kCache = 3 * 512 * 56;
  const TemporaryFolder folder;
  const auto store = open_borders(folder.path(), {.max_zoom = 5, .cache_bytes = kCache});
  BorderModel model;
  publish_some(*store, model, 0, kBorderNumbers);
  EXPECT_GT(store->memory_bytes(), kBorderNumbers * 57);
  store->seal();
  EXPECT_LT(store->memory_bytes(), kBorderNumbers / 512 * 200);
  expect_all(*store, model);
  EXPECT_GT(store->memory_bytes(), kCache);
  EXPECT_LT(store->memory_bytes(), kCache + kBorderNumbers / 512 * 200);
}

TEST(Hdf5BorderStore, TakesWhatIsNotSealedWithoutTheDisk) {
  const TemporaryFolder folder;
  const auto store = open_borders(folder.path() / "run", kOptions);
  BorderModel model;
  publish_some(*store, model, 0, 10);
  fs::remove_all(folder.path() / "run");
  expect_all(*store, model);
  EXPECT_THROW(store->seal(), IoError);
}

TEST(Hdf5BorderStore, ThrowsWhenTheFolderGoesAwayUnderIt) {
  const TemporaryFolder folder;
  const auto store = open_borders(folder.path() / "run", kOptions);
  BorderModel model;
  publish_some(*store, model, 0, 10);
  store->seal();
  fs::remove_all(folder.path() / "run");
  EXPECT_THROW(expect_all(*store, model), IoError);
}

TEST(Hdf5BorderStore, SharesItsFolderWithALatticeStore) {
  const TemporaryFolder folder;
  const BorderModel model = make_segment(folder.path(), 20);
  const fs::path torn = border_segment_path(folder.path(), 1).string() + kTemporarySuffix;
  write_file_atomically(torn, std::vector<std::uint8_t>(1000, 7));
  {
    const auto lattice = open_hdf5_lattice_store(folder.path(), kGeodetic, {.max_zoom = 5});
    ASSERT_TRUE(lattice.ok());
    (*lattice)->put_block({}, std::vector<float>(std::size_t{256} * 256, 5.0F));
  }
  EXPECT_EQ(count_lattice_segments(folder.path()), 1);
  EXPECT_EQ(count_border_segments(folder.path()), 1);
  EXPECT_TRUE(fs::exists(torn)) << "a border store may be about to write it";
  expect_all(*open_borders(folder.path(), kOptions), model);
  EXPECT_FALSE(fs::exists(torn));
}

TEST(Hdf5BorderStore, OnlyWhatWasSealedOutlivesACrash) {
  const TemporaryFolder folder;
  const pid_t child = ::fork();
  ASSERT_GE(child, 0);
  if (child == 0) {
    BorderModel ignored;
    const auto store = open_borders(folder.path(), kOptions);
    publish_some(*store, ignored, 0, 5);
    store->seal();
    publish_some(*store, ignored, 5, 8);
    ::_exit(0);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  ASSERT_EQ(status, 0);
  const auto store = open_borders(folder.path(), kOptions);
  EXPECT_EQ(take(*store, 4), mask_of_seed(4));
  EXPECT_THROW(take(*store, 5), InternalError);
}

std::string error_of_sealing(BorderStore& store) {
  try {
    store.seal();
  } catch (const IoError& error) {
    return error.what();
  }
  return "";
}

TEST(Hdf5BorderStore, LosesNothingWhenAFileMayNotGrow) {
  const TemporaryFolder folder;
  BorderModel model;
  {
    const auto store = open_borders(folder.path(), kOptions);
    publish_some(*store, model, 0, 3000);
    {
      const FileSizeLimit limit(8192);
      const std::string message = error_of_sealing(*store);
      EXPECT_THAT(message, HasSubstr("borders-000000.h5"));
      EXPECT_THAT(message, HasSubstr("ulimit -f"));
    }
    EXPECT_EQ(count_border_segments(folder.path()), 0);
    EXPECT_EQ(take(*store, 7), model.at(7));
    publish_some(*store, model, 3000, 3100);
    store->seal();
    EXPECT_EQ(take(*store, 8), model.at(8));
  }
  EXPECT_EQ(count_border_segments(folder.path()), 1);
  expect_all(*open_borders(folder.path(), kOptions), model);
}

TEST(Hdf5BorderStore, LosesNothingOnAFullDisk) {
  const TemporaryFolder folder;
  const SmallDisk disk(folder.path());
  if (!disk.is_mounted()) GTEST_SKIP() << "needs the right to mount a tmpfs (root)";
  const fs::path filler = folder.path() / "filler";
  write_file_atomically(filler, std::vector<std::uint8_t>(2'050'000, 1));
  BorderModel model;
  {
    const auto store = open_borders(folder.path() / "run", kOptions);
    publish_some(*store, model, 0, 3000);
    const std::string message = error_of_sealing(*store);
    EXPECT_THAT(message, HasSubstr("No space left on device"));
    EXPECT_THAT(message, HasSubstr("Free some space"));
    fs::remove(filler);
    store->seal();
  }
  expect_all(*open_borders(folder.path() / "run", kOptions), model);
}

TEST(Hdf5BorderStore, IsAnOrdinaryHdf5FileToOtherPrograms) {
  if (output_of("command -v h5dump").empty()) GTEST_SKIP() << "needs h5dump (hdf5-tools)";
  const TemporaryFolder folder;
  make_segment(folder.path(), 1200);
  const std::string path = border_segment_path(folder.path(), 0).string();
  const std::string header = output_of("h5dump -H -p " + path);
  EXPECT_THAT(header, HasSubstr("FILTER_ID 32015"));
  EXPECT_THAT(header, HasSubstr("PREPROCESSING SHUFFLE"));
  EXPECT_THAT(header, HasSubstr("SIMPLE { ( 1200 ) / ( 1200 ) }"));
  EXPECT_THAT(header, HasSubstr("CHUNKED ( 512 )"));
  EXPECT_THAT(header, HasSubstr("[33] H5T_STD_U8LE } \"mask\""));
  // Border 3 * 512 is the west side of tile 5/0/6.
  EXPECT_THAT(output_of("h5dump -d chunk_first " + path), HasSubstr("(1,0): 5, 0, 6, 0"));
  EXPECT_THAT(output_of("h5dump -a scheme " + path), HasSubstr("\"geodetic\""));
}

// Undoes the two filters itself, as the zstd plugin of HDF5 is in no package of Debian's.
constexpr char kReadWithH5py[] = R"(
import sys, h5py, numpy as np, zstandard
borders = h5py.File(sys.argv[1])['borders']
(records,), size = borders.chunks, borders.dtype.itemsize
planes = [np.frombuffer(zstandard.decompress(borders.id.read_direct_chunk((row,))[1]), np.uint8)
          for row in range(0, len(borders), records)]
plain = b''.join(p.reshape(size, records).T.tobytes() for p in planes)
masks = np.frombuffer(plain, borders.dtype)[:len(borders)]['mask']
print(*np.unpackbits(masks, axis=-1, count=257, bitorder='little').sum(axis=1), end=' ')
)";

TEST(Hdf5BorderStore, H5pyReadsTheMasks) {
  // A python3 from elsewhere has not what Debian's packages bring.
  std::string python;
  for (const std::string candidate : {"python3", "/usr/bin/python3"}) {
    if (output_of(candidate + " -c 'import h5py, numpy, zstandard'").empty()) python = candidate;
  }
  if (python.empty()) GTEST_SKIP() << "needs python3-h5py and python3-zstandard";
  const TemporaryFolder folder;
  const BorderModel model = make_segment(folder.path(), 700);
  std::string expected;
  for (const auto& [n, mask] : model) expected += std::to_string(mask.count()) + " ";
  folder.put("read.py", kReadWithH5py);
  EXPECT_EQ(output_of(python + " " + (folder.path() / "read.py").string() + " " +
                      border_segment_path(folder.path(), 0).string()),
            expected);
}

}  // namespace
}  // namespace qmpipe::hdf5_border_store_test
