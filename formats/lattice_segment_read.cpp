#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <optional>

#include "formats/block_codec.h"
#include "formats/hdf5_handle.h"
#include "formats/lattice_segment.h"
#include "formats/lattice_window.h"

namespace qmpipe {
namespace {

constexpr hsize_t kSide = kBlockPosts;
constexpr const char* kRebuild = "remove the run folder, or build with --overwrite, to start over";

class SegmentReader {
 public:
  SegmentReader(const std::filesystem::path& path, std::int64_t file) : path_(path), file_(file) {}

  Result<std::vector<SegmentEntry>> read(const TilingScheme& scheme, std::int32_t max_zoom) const;

 private:
  Error refused(const std::string& cause) const {
    return Error{fmt::format("{}: {}; {}", path_.string(), cause, kRebuild)};
  }
  Error refused_by_hdf5(const std::string& what) const {
    return refused(fmt::format("{} cannot be read: {}", what, hdf5_cause()));
  }
  template <class T>
  Result<std::vector<T>> dataset(const char* name, hid_t memory_type, hsize_t columns) const;
  Result<std::string> scheme_attribute() const;
  Result<std::int32_t> version_attribute() const;
  std::optional<Error> locate_chunks(std::vector<SegmentEntry>& entries) const;
  std::optional<Error> check_header(const TilingScheme& scheme) const;

  const std::filesystem::path& path_;
  hid_t file_;
};

// All values of a dataset of shape (n) or, with several columns, (n, columns).
template <class T>
Result<std::vector<T>> SegmentReader::dataset(const char* name, hid_t memory_type,
                                              hsize_t columns) const {
  const std::string what = fmt::format("the dataset `{}`", name);
  const Hdf5Handle data(H5Dopen2(file_, name, H5P_DEFAULT), H5Dclose);
  if (!data.ok()) return refused_by_hdf5(what);
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  const int dimensions = columns > 1 ? 2 : 1;
  if (!space.ok() || H5Sget_simple_extent_ndims(space.id()) != dimensions) {
    return refused(what + " has another shape than it should");
  }
  std::array<hsize_t, 2> shape = {0, 1};
  H5Sget_simple_extent_dims(space.id(), shape.data(), nullptr);
  if (shape[0] < 1 || shape[0] > kMaxSegmentBlocks || shape[1] != columns) {
    return refused(what + " has another shape than it should");
  }
  std::vector<T> values(shape[0] * columns);
  if (H5Dread(data.id(), memory_type, H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    return refused_by_hdf5(what);
  }
  return values;
}

Result<std::int32_t> SegmentReader::version_attribute() const {
  const Hdf5Handle attribute(H5Aopen(file_, "format_version", H5P_DEFAULT), H5Aclose);
  std::int32_t version = 0;
  if (!attribute.ok() || H5Aget_storage_size(attribute.id()) != sizeof(version) ||
      H5Aread(attribute.id(), H5T_NATIVE_INT32, &version) < 0) {
    return refused("it has no format version");
  }
  return version;
}

Result<std::string> SegmentReader::scheme_attribute() const {
  const Hdf5Handle attribute(H5Aopen(file_, "scheme", H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return refused("it names no tiling scheme");
  const Hdf5Handle type(H5Aget_type(attribute.id()), H5Tclose);
  const hsize_t size_bytes = H5Aget_storage_size(attribute.id());
  if (!type.ok() || H5Tget_class(type.id()) != H5T_STRING || size_bytes > 64 ||
      H5Tis_variable_str(type.id()) != 0) {
    return refused("it names no tiling scheme");
  }
  std::string text(size_bytes, '\0');
  if (H5Aread(attribute.id(), type.id(), text.data()) < 0) {
    return refused("it names no tiling scheme");
  }
  return text;
}

std::optional<Error> SegmentReader::check_header(const TilingScheme& scheme) const {
  const auto version = version_attribute();
  if (!version) return version.error();
  if (*version != kSegmentFormatVersion) {
    return refused(fmt::format("its format version is {}, this program reads {}", *version,
                               kSegmentFormatVersion));
  }
  const auto name = scheme_attribute();
  if (!name) return name.error();
  if (*name != segment_scheme_name(scheme)) {
    return refused(fmt::format("its tiling scheme is {}, the run's is {}", *name,
                               segment_scheme_name(scheme)));
  }
  return std::nullopt;
}

std::optional<Error> SegmentReader::locate_chunks(std::vector<SegmentEntry>& entries) const {
  const Hdf5Handle data(H5Dopen2(file_, "blocks", H5P_DEFAULT), H5Dclose);
  if (!data.ok()) return refused_by_hdf5("the dataset `blocks`");
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  std::array<hsize_t, 3> shape = {};
  if (!space.ok() || H5Sget_simple_extent_ndims(space.id()) != 3 ||
      H5Sget_simple_extent_dims(space.id(), shape.data(), nullptr) < 0 ||
      shape != std::array<hsize_t, 3>{entries.size(), kSide, kSide}) {
    return refused("the dataset `blocks` has another shape than it should");
  }
  hsize_t count = 0;
  if (H5Dget_num_chunks(data.id(), space.id(), &count) < 0) {
    return refused_by_hdf5("the dataset `blocks`");
  }
  for (hsize_t k = 0; k < count; ++k) {
    std::array<hsize_t, 3> at = {};
    unsigned mask = 0;
    haddr_t address = 0;
    hsize_t bytes = 0;
    if (H5Dget_chunk_info(data.id(), space.id(), k, at.data(), &mask, &address, &bytes) < 0) {
      return refused_by_hdf5("the dataset `blocks`");
    }
    if (at[0] >= entries.size() || mask != 0 || bytes > BlockCodec::largest_chunk_bytes()) {
      return refused(fmt::format("chunk {} of `blocks` is none of qmpipe's", k));
    }
    entries[at[0]].chunk = {.offset = address, .bytes = bytes};
  }
  return std::nullopt;
}

Result<std::vector<SegmentEntry>> SegmentReader::read(const TilingScheme& scheme,
                                                      std::int32_t max_zoom) const {
  if (const auto error = check_header(scheme)) return *error;
  const auto keys = dataset<std::int32_t>("keys", H5T_NATIVE_INT32, 3);
  if (!keys) return keys.error();
  const auto is_void = dataset<std::uint8_t>("is_void", H5T_NATIVE_UINT8, 1);
  if (!is_void) return is_void.error();
  const auto hashes = dataset<std::uint64_t>("content_hash", H5T_NATIVE_UINT64, 1);
  if (!hashes) return hashes.error();
  const std::size_t rows = is_void->size();
  if (keys->size() != 3 * rows || hashes->size() != rows) {
    return refused("its datasets have different lengths");
  }
  std::vector<SegmentEntry> entries(rows);
  if (const auto error = locate_chunks(entries)) return *error;
  for (std::size_t k = 0; k < rows; ++k) {
    SegmentEntry& entry = entries[k];
    entry.key = {.zoom = (*keys)[3 * k], .x = (*keys)[3 * k + 1], .y = (*keys)[3 * k + 2]};
    entry.content_hash = (*hashes)[k];
    if (!is_block_of(scheme, max_zoom, entry.key)) {
      return refused(fmt::format("its block {} lies outside the {} scheme of zooms 0 to {}",
                                 to_string(entry.key), segment_scheme_name(scheme), max_zoom));
    }
    if ((*is_void)[k] != (entry.chunk.bytes == 0 ? 1 : 0)) {
      return refused(fmt::format("its block {} has no data", to_string(entry.key)));
    }
  }
  return entries;
}

}  // namespace

Result<std::vector<SegmentEntry>> read_lattice_segment(const std::filesystem::path& path,
                                                       const TilingScheme& scheme,
                                                       std::int32_t max_zoom) {
  if (const auto error = check_seal(path)) {
    return Error{fmt::format("{}; {}", error->message, kRebuild)};
  }
  silence_hdf5();
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // Some network file systems cannot lock, and a finished segment never changes.
  if (access.ok()) H5Pset_file_locking(access.id(), false, true);
  const Hdf5Handle file(
      H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.ok() ? access.id() : H5P_DEFAULT), H5Fclose);
  if (!file.ok()) {
    return Error{
        fmt::format("{}: HDF5 cannot open it: {}; {}", path.string(), hdf5_cause(), kRebuild)};
  }
  return SegmentReader(path, file.id()).read(scheme, max_zoom);
}

}  // namespace qmpipe
