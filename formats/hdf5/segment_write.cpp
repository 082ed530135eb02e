#include <hdf5.h>

#include <algorithm>
#include <array>
#include <type_traits>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/hdf5/segment.h"
#include "formats/hdf5/segment_files.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kImageStepBytes = std::size_t{1} << 20U;
constexpr std::size_t kMostDimensions = 4;

// A type in the file, and the same in memory.
template <class T>
std::pair<hid_t, hid_t> types_of() {
  if constexpr (std::is_same_v<T, std::int32_t>) return {H5T_STD_I32LE, H5T_NATIVE_INT32};
  if constexpr (std::is_same_v<T, std::uint8_t>) return {H5T_STD_U8LE, H5T_NATIVE_UINT8};
  if constexpr (std::is_same_v<T, double>) return {H5T_IEEE_F64LE, H5T_NATIVE_DOUBLE};
  return {H5T_STD_U64LE, H5T_NATIVE_UINT64};
}

}  // namespace

const char* segment_scheme_name(const TilingScheme& scheme) {
  return scheme.projection() == Projection::kGeodetic ? "geodetic" : "mercator";
}

SegmentIdentity store_identity(std::int32_t format_version, const TilingScheme& scheme) {
  return {.format_version = format_version,
          .attribute = "scheme",
          .value = segment_scheme_name(scheme),
          .called = "tiling scheme",
          .wanted_by = "the run's",
          .remedy = kStartOver};
}

Hdf5SegmentWriter::Hdf5SegmentWriter(std::filesystem::path path, const SegmentIdentity& identity)
    : path_(std::move(path)), file_(create_file()) {
  write_version(identity.format_version);
  write_text(identity.attribute, identity.value);
}

Hdf5Handle Hdf5SegmentWriter::made(std::int64_t id, Hdf5Handle::Close close) const {
  if (id < 0) fail();
  return {id, close};
}

void Hdf5SegmentWriter::check(int status) const {
  if (status < 0) fail();
}

void Hdf5SegmentWriter::fail() const {
  throw IoError("cannot make the HDF5 file", path_.string(), hdf5_cause(), "");
}

Hdf5Handle Hdf5SegmentWriter::create_file() const {
  silence_hdf5();
  const Hdf5Handle access = made(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  check(H5Pset_fapl_core(access.id(), kImageStepBytes, false));
  // What the reader knows (formats/hdf5/structure.h), whatever later versions do by themselves.
  check(H5Pset_libver_bounds(access.id(), H5F_LIBVER_EARLIEST, H5F_LIBVER_LATEST));
  return made(H5Fcreate(path_.c_str(), H5F_ACC_TRUNC, H5P_DEFAULT, access.id()), H5Fclose);
}

void Hdf5SegmentWriter::write_version(std::int32_t format_version) const {
  const Hdf5Handle scalar = made(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle version = made(H5Acreate2(file_.id(), "format_version", H5T_STD_I32LE,
                                             scalar.id(), H5P_DEFAULT, H5P_DEFAULT),
                                  H5Aclose);
  check(H5Awrite(version.id(), H5T_NATIVE_INT32, &format_version));
}

void Hdf5SegmentWriter::write_text(const char* name, const std::string& text) const {
  QMPIPE_CHECK(!text.empty());
  const Hdf5Handle scalar = made(H5Screate(H5S_SCALAR), H5Sclose);
  const Hdf5Handle type = made(H5Tcopy(H5T_C_S1), H5Tclose);
  check(H5Tset_size(type.id(), text.size()));
  const Hdf5Handle attribute = made(
      H5Acreate2(file_.id(), name, type.id(), scalar.id(), H5P_DEFAULT, H5P_DEFAULT), H5Aclose);
  check(H5Awrite(attribute.id(), type.id(), text.data()));
}

void Hdf5SegmentWriter::create_chunked(const char* name, std::int64_t type,
                                       const std::vector<std::uint64_t>& shape,
                                       const std::vector<std::uint64_t>& chunk_shape,
                                       std::int64_t fill_type, const void* fill) {
  QMPIPE_CHECK(shape.size() == chunk_shape.size() && shape.size() <= kMostDimensions);
  const auto rank = static_cast<int>(shape.size());
  const std::vector<hsize_t> size(shape.begin(), shape.end());
  const std::vector<hsize_t> chunk(chunk_shape.begin(), chunk_shape.end());
  const Hdf5Handle space = made(H5Screate_simple(rank, size.data(), nullptr), H5Sclose);
  const Hdf5Handle creation = made(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  // The time would differ from run to run.
  check(H5Pset_obj_track_times(creation.id(), false));
  check(H5Pset_chunk(creation.id(), rank, chunk.data()));
  if (fill != nullptr) check(H5Pset_fill_value(creation.id(), fill_type, fill));
  check(H5Pset_shuffle(creation.id()));
  // Optional: a mandatory filter must be there when the dataset is made, and the plugin rarely is.
  const unsigned level = 1;
  check(H5Pset_filter(creation.id(), kZstdFilter, H5Z_FLAG_OPTIONAL, 1, &level));
  chunked_.push_back(
      made(H5Dcreate2(file_.id(), name, type, space.id(), H5P_DEFAULT, creation.id(), H5P_DEFAULT),
           H5Dclose));
}

void Hdf5SegmentWriter::write_chunk(std::uint64_t row, std::span<const std::uint8_t> chunk) {
  const std::array<hsize_t, kMostDimensions> at = {row};
  check(
      H5Dwrite_chunk(chunked_.back().id(), H5P_DEFAULT, 0, at.data(), chunk.size(), chunk.data()));
}

template <class T>
void Hdf5SegmentWriter::write_values(const char* name, std::size_t columns,
                                     const std::vector<T>& values) {
  const auto [file_type, memory_type] = types_of<T>();
  const std::array<hsize_t, 2> shape = {values.size() / columns, columns};
  const Hdf5Handle space =
      made(H5Screate_simple(columns > 1 ? 2 : 1, shape.data(), nullptr), H5Sclose);
  const Hdf5Handle creation = made(H5Pcreate(H5P_DATASET_CREATE), H5Pclose);
  check(H5Pset_obj_track_times(creation.id(), false));
  const Hdf5Handle dataset = made(
      H5Dcreate2(file_.id(), name, file_type, space.id(), H5P_DEFAULT, creation.id(), H5P_DEFAULT),
      H5Dclose);
  check(H5Dwrite(dataset.id(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()));
}

template void Hdf5SegmentWriter::write_values(const char*, std::size_t,
                                              const std::vector<std::int32_t>&);
template void Hdf5SegmentWriter::write_values(const char*, std::size_t,
                                              const std::vector<std::uint8_t>&);
template void Hdf5SegmentWriter::write_values(const char*, std::size_t,
                                              const std::vector<std::uint64_t>&);
template void Hdf5SegmentWriter::write_values(const char*, std::size_t, const std::vector<double>&);

std::vector<LocatedChunk> Hdf5SegmentWriter::locate_chunks() const {
  QMPIPE_CHECK(chunked_.size() == 1);
  const std::int64_t data = chunked_.front().id();
  hsize_t count = 0;
  const Hdf5Handle space = made(H5Dget_space(data), H5Sclose);
  check(H5Dget_num_chunks(data, space.id(), &count));
  std::vector<LocatedChunk> chunks;
  for (hsize_t k = 0; k < count; ++k) {
    std::array<hsize_t, kMostDimensions> at = {};
    unsigned mask = 0;
    haddr_t address = 0;
    hsize_t bytes = 0;
    check(H5Dget_chunk_info(data, space.id(), k, at.data(), &mask, &address, &bytes));
    chunks.push_back({.row = at[0], .range = {.offset = address, .bytes = bytes}});
  }
  return chunks;
}

std::vector<std::uint8_t> Hdf5SegmentWriter::image() const {
  check(H5Fflush(file_.id(), H5F_SCOPE_GLOBAL));
  const ssize_t size_bytes = H5Fget_file_image(file_.id(), nullptr, 0);
  if (size_bytes < 0) fail();
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(size_bytes));
  if (H5Fget_file_image(file_.id(), bytes.data(), bytes.size()) != size_bytes) fail();
  return bytes;
}

Hdf5SegmentWriter::Finished Hdf5SegmentWriter::finish() {
  Finished finished = {.bytes = image(), .chunks = locate_chunks()};
  std::vector<ByteRange> payload;
  for (const LocatedChunk& chunk : finished.chunks) payload.push_back(chunk.range);
  append_seal(finished.bytes, std::move(payload));
  return finished;
}

std::vector<std::uint8_t> Hdf5SegmentWriter::finish_whole(std::size_t least_bytes) {
  std::vector<std::uint8_t> bytes = image();
  bytes.resize(std::max(bytes.size(), least_bytes));
  append_seal(bytes, {});
  return bytes;
}

}  // namespace qmpipe
