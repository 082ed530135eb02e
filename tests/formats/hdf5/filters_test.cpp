// Our files through HDF5's own filter pipeline, with zstd registered as the plugin would: what h5py
// and others get.
#include <gtest/gtest.h>
#include <hdf5.h>
#include <zstd.h>

#include <array>
#include <cstdlib>
#include <vector>

#include "formats/detail_model/arrays.h"
#include "formats/detail_model/file.h"
#include "formats/hdf5/handle.h"
#include "formats/hdf5/segment_files.h"
#include "tests/support/random_borders.h"
#include "tests/support/random_detail_model.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::filters_test {
namespace {

using testing::border_of_number;
using testing::mask_of_seed;
using testing::TemporaryFolder;

constexpr H5Z_filter_t kZstdFilter = 32015;

// Decompresses only. HDF5 owns the buffer, which is malloc's.
std::size_t zstd_filter(unsigned flags, std::size_t /*count*/, const unsigned* /*values*/,
                        std::size_t bytes, std::size_t* buffer_bytes, void** buffer) {
  if ((flags & H5Z_FLAG_REVERSE) == 0) return 0;
  const auto plain_bytes = ZSTD_getFrameContentSize(*buffer, bytes);
  if (plain_bytes > 1U << 24U) return 0;
  void* plain = std::malloc(plain_bytes);
  if (plain == nullptr || ZSTD_isError(ZSTD_decompress(plain, plain_bytes, *buffer, bytes)) != 0) {
    std::free(plain);
    return 0;
  }
  std::free(*buffer);
  *buffer = plain;
  *buffer_bytes = plain_bytes;
  return plain_bytes;
}

// The fields of a record by name, as another program would ask for them.
struct ReadRecord {
  std::int32_t zoom, x, y;
  std::uint8_t side;
  std::array<std::uint8_t, kMaskBytes> mask;
};

void register_zstd() {
  const H5Z_class2_t filter = {H5Z_CLASS_T_VERS, kZstdFilter, 1,       1,
                               "zstd",           nullptr,     nullptr, zstd_filter};
  EXPECT_GE(H5Zregister(&filter), 0);
}

std::vector<ReadRecord> read_records(const std::filesystem::path& path, std::size_t count) {
  register_zstd();
  const hsize_t mask_bytes = kMaskBytes;
  const Hdf5Handle mask(H5Tarray_create2(H5T_NATIVE_UINT8, 1, &mask_bytes), H5Tclose);
  const Hdf5Handle type(H5Tcreate(H5T_COMPOUND, sizeof(ReadRecord)), H5Tclose);
  H5Tinsert(type.id(), "mask", HOFFSET(ReadRecord, mask), mask.id());
  H5Tinsert(type.id(), "side", HOFFSET(ReadRecord, side), H5T_NATIVE_UINT8);
  H5Tinsert(type.id(), "y", HOFFSET(ReadRecord, y), H5T_NATIVE_INT32);
  H5Tinsert(type.id(), "x", HOFFSET(ReadRecord, x), H5T_NATIVE_INT32);
  H5Tinsert(type.id(), "zoom", HOFFSET(ReadRecord, zoom), H5T_NATIVE_INT32);
  const Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  const Hdf5Handle data(H5Dopen2(file.id(), "borders", H5P_DEFAULT), H5Dclose);
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  EXPECT_EQ(H5Sget_simple_extent_npoints(space.id()), static_cast<hssize_t>(count));
  std::vector<ReadRecord> records(count);
  EXPECT_GE(H5Dread(data.id(), type.id(), H5S_ALL, H5S_ALL, H5P_DEFAULT, records.data()), 0);
  return records;
}

TEST(Hdf5Filters, ReadEveryFieldOfEveryBorder) {
  constexpr std::int32_t kCount = 1300;  // three chunks, the last one not full
  const TemporaryFolder folder;
  const auto store = testing::open_borders(folder.path(), {.max_zoom = 5});
  for (std::int32_t n = kCount - 1; n >= 0; --n) {
    testing::publish(*store, n, mask_of_seed(static_cast<std::uint64_t>(n)));
  }
  store->seal();
  const auto records = read_records(segment_path(folder.path(), SegmentKind::kBorders, 0), kCount);
  for (std::int32_t n = 0; n < kCount; ++n) {
    const ReadRecord& record = records[static_cast<std::size_t>(n)];
    const BorderKey key = border_of_number(n);
    ASSERT_EQ((TileKey{.zoom = record.zoom, .x = record.x, .y = record.y}), key.owner);
    ASSERT_EQ(record.side, index_of(key.side));
    const BorderMask mask = mask_of_seed(static_cast<std::uint64_t>(n));
    for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
      const unsigned byte = record.mask[static_cast<std::size_t>(k / 8)];
      ASSERT_EQ((byte >> (k % 8) & 1U) != 0, mask.test(k)) << "post " << k << " of border " << n;
    }
  }
}

TEST(Hdf5Filters, ReadEveryWordOfADetailFile) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "model.h5";
  std::mt19937_64 random(7);
  DetailModel model;
  model.blocks = {testing::random_detail_block(random, 50, 60, 70000)};  // two chunks
  write_detail_file(path, model);
  register_zstd();
  const DetailArrays arrays = encode_detail(model);
  const Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, H5P_DEFAULT), H5Fclose);
  for (std::size_t k = 0; k < kDetailArrayCount; ++k) {
    SCOPED_TRACE(kDetailArrayNames[k]);
    if (arrays[k].empty()) {
      ASSERT_EQ(H5Lexists(file.id(), kDetailArrayNames[k], H5P_DEFAULT), 0);
      continue;
    }
    const Hdf5Handle data(H5Dopen2(file.id(), kDetailArrayNames[k], H5P_DEFAULT), H5Dclose);
    const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
    ASSERT_EQ(H5Sget_simple_extent_npoints(space.id()), std::ssize(arrays[k]));
    std::vector<std::uint32_t> words(arrays[k].size());
    ASSERT_GE(H5Dread(data.id(), H5T_NATIVE_UINT32, H5S_ALL, H5S_ALL, H5P_DEFAULT, words.data()),
              0);
    EXPECT_EQ(words, arrays[k]);
  }
}

}  // namespace
}  // namespace qmpipe::filters_test
