#include <hdf5.h>

#include <array>
#include <limits>

#include "formats/errors.h"
#include "formats/hash64.h"
#include "formats/hdf5_handle.h"
#include "formats/lattice_segment.h"
#include "formats/lattice_window.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr H5Z_filter_t kZstdFilter = 32015;
constexpr hsize_t kSide = kBlockPosts;
constexpr std::size_t kImageStepBytes = std::size_t{1} << 20U;

class SegmentEncoder {
 public:
  explicit SegmentEncoder(const std::filesystem::path& path) : path_(path) { silence_hdf5(); }

  EncodedSegment encode(const TilingScheme& scheme,
                        const std::vector<std::shared_ptr<const PackedBlock>>& blocks);

 private:
  Hdf5Handle made(hid_t id, Hdf5Handle::Close close) const {
    if (id < 0) fail();
    return {id, close};
  }
  void check(herr_t status) const {
    if (status < 0) fail();
  }
  [[noreturn]] void fail() const {
    throw IoError("cannot make the HDF5 file", path_.string(), hdf5_cause(), "");
  }

  Hdf5Handle create_file() const;
  Hdf5Handle create_blocks(hid_t file, hsize_t rows) const;
  template <class T>
  void write_dataset(hid_t file, const char* name, hid_t type, const std::vector<hsize_t>& shape,
                     const std::vector<T>& values) const;
  void write_attributes(hid_t file, const TilingScheme& scheme) const;
  void locate_chunks(hid_t dataset, std::vector<SegmentEntry>& entries) const;
  std::vector<std::uint8_t> image_of(hid_t file) const;

  const std::filesystem::path& path_;
};

Hdf5Handle SegmentEncoder::create_file() const {
  const Hdf5Handle access = made(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  check(H5Pset_fapl_core(access.id(), kImageStepBytes, false));
  return made(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
}

Hdf5Handle SegmentEncoder::create_blocks(hid_t file, hsize_t rows) const {
  const std::array<hsize_t, 3> shape = {rows, kSide, kSide};
  const std::array<hsize_t, 3> chunk = {1, kSide, kSide};
  const Hdf5Handle space = made(H5Screate_simple(3, shape.data(), nullptr), H5Sclose);
  const Hdf5Handle creation = made(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  check(H5Pset_chunk(creation.id(), 3, chunk.data()));
  // So that a block without a chunk reads as void.
  const float fill_m = std::numeric_limits<float>::quiet_NaN();
  check(H5Pset_fill_value(creation.id(), H5T_NATIVE_FLOAT, &fill_m));
  check(H5Pset_shuffle(creation.id()));
  // Optional: a mandatory filter must be there when the dataset is made, and the plugin rarely is.
  const unsigned level = 1;
  check(H5Pset_filter(creation.id(), kZstdFilter, H5Z_FLAG_OPTIONAL, 1, &level));
  return made(H5Dcreate2(file, "blocks", H5T_IEEE_F32LE, space.id(), H5P_DEFAULT, creation.id(),
                         H5P_DEFAULT),
              H5Dclose);
}

template <class T>
void SegmentEncoder::write_dataset(hid_t file, const char* name, hid_t type,
                                   const std::vector<hsize_t>& shape,
                                   const std::vector<T>& values) const {
  const Hdf5Handle space =
      made(H5Screate_simple(static_cast<int>(shape.size()), shape.data(), nullptr), H5Sclose);
  const Hdf5Handle dataset = made(
      H5Dcreate2(file, name, type, space.id(), H5P_DEFAULT, H5P_DEFAULT, H5P_DEFAULT), H5Dclose);
  check(H5Dwrite(dataset.id(), type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
}

void SegmentEncoder::write_attributes(hid_t file, const TilingScheme& scheme) const {
  const Hdf5Handle scalar = made(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle version =
      made(H5Acreate2(file, "format_version", H5T_STD_I32LE, scalar.id(), H5P_DEFAULT, H5P_DEFAULT),
           H5Aclose);
  check(H5Awrite(version.id(), H5T_NATIVE_INT32, &kSegmentFormatVersion));
  const std::string text = segment_scheme_name(scheme);
  const Hdf5Handle type = made(H5Tcopy(H5T_C_S1), H5Tclose);
  check(H5Tset_size(type.id(), text.size()));
  const Hdf5Handle name =
      made(H5Acreate2(file, "scheme", type.id(), scalar.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  check(H5Awrite(name.id(), type.id(), text.data()));
}

void SegmentEncoder::locate_chunks(hid_t dataset, std::vector<SegmentEntry>& entries) const {
  hsize_t count = 0;
  const Hdf5Handle space = made(H5Dget_space(dataset), H5Sclose);
  check(H5Dget_num_chunks(dataset, space.id(), &count));
  for (hsize_t k = 0; k < count; ++k) {
    std::array<hsize_t, 3> at = {};
    unsigned mask = 0;
    haddr_t address = 0;
    hsize_t bytes = 0;
    check(H5Dget_chunk_info(dataset, space.id(), k, at.data(), &mask, &address, &bytes));
    entries.at(at[0]).chunk = {.offset = address, .bytes = bytes};
  }
}

std::vector<std::uint8_t> SegmentEncoder::image_of(hid_t file) const {
  check(H5Fflush(file, H5F_SCOPE_GLOBAL));
  const ssize_t size_bytes = H5Fget_file_image(file, nullptr, 0);
  if (size_bytes < 0) fail();
  std::vector<std::uint8_t> image(static_cast<std::size_t>(size_bytes));
  if (H5Fget_file_image(file, image.data(), image.size()) != size_bytes) fail();
  return image;
}

EncodedSegment SegmentEncoder::encode(
    const TilingScheme& scheme, const std::vector<std::shared_ptr<const PackedBlock>>& blocks) {
  const hsize_t rows = blocks.size();
  EncodedSegment segment;
  std::vector<std::int32_t> keys;
  std::vector<std::uint8_t> is_void;
  std::vector<std::uint64_t> hashes;
  const Hdf5Handle file = create_file();
  const Hdf5Handle dataset = create_blocks(file.id(), rows);
  for (const auto& block : blocks) {
    const std::array<hsize_t, 3> at = {segment.entries.size(), 0, 0};
    if (!block->chunk.empty()) {
      check(H5Dwrite_chunk(dataset.id(), H5P_DEFAULT, 0, at.data(), block->chunk.size(),
                           block->chunk.data()));
    }
    keys.insert(keys.end(), {block->key.zoom, block->key.x, block->key.y});
    is_void.push_back(block->chunk.empty() ? 1 : 0);
    hashes.push_back(block->content_hash);
    segment.entries.push_back(
        {.key = block->key, .chunk = {}, .content_hash = block->content_hash});
  }
  write_dataset(file.id(), "keys", H5T_STD_I32LE, {rows, 3}, keys);
  write_dataset(file.id(), "is_void", H5T_STD_U8LE, {rows}, is_void);
  write_dataset(file.id(), "content_hash", H5T_STD_U64LE, {rows}, hashes);
  write_attributes(file.id(), scheme);
  segment.bytes = image_of(file.id());
  locate_chunks(dataset.id(), segment.entries);
  std::vector<ByteRange> payload;
  for (const SegmentEntry& entry : segment.entries) {
    if (entry.chunk.bytes > 0) payload.push_back(entry.chunk);
  }
  append_seal(segment.bytes, std::move(payload));
  return segment;
}

}  // namespace

const char* segment_scheme_name(const TilingScheme& scheme) {
  return scheme.projection() == Projection::kGeodetic ? "geodetic" : "mercator";
}

std::uint64_t content_hash(const TileKey& key, std::span<const std::uint8_t> chunk) {
  return hash64(chunk, packed(key));
}

EncodedSegment encode_lattice_segment(
    const std::filesystem::path& path, const TilingScheme& scheme,
    const std::vector<std::shared_ptr<const PackedBlock>>& blocks) {
  QMPIPE_CHECK(!blocks.empty() && blocks.size() <= kMaxSegmentBlocks);
  return SegmentEncoder(path).encode(scheme, blocks);
}

}  // namespace qmpipe
