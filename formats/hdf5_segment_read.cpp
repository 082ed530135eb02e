#include <fmt/format.h>
#include <hdf5.h>

#include <array>
#include <type_traits>

#include "formats/hdf5_segment.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostDimensions = 4;
constexpr std::size_t kMostIdentityBytes = 64;

template <class T>
hid_t memory_type_of() {
  if constexpr (std::is_same_v<T, std::int32_t>) return H5T_NATIVE_INT32;
  if constexpr (std::is_same_v<T, std::uint8_t>) return H5T_NATIVE_UINT8;
  if constexpr (std::is_same_v<T, double>) return H5T_NATIVE_DOUBLE;
  return H5T_NATIVE_UINT64;
}

std::string dataset_named(const std::string& name) { return fmt::format("the dataset `{}`", name); }

}  // namespace

Error Hdf5SegmentReader::refused(const std::string& cause) const {
  return Error{fmt::format("{}: {}; {}", path_.string(), cause, remedy_)};
}

Error Hdf5SegmentReader::refused_shape(const std::string& name) const {
  return refused(dataset_named(name) + " has another shape than it should");
}

Error Hdf5SegmentReader::refused_by_hdf5(const std::string& what) const {
  return refused(fmt::format("{} cannot be read: {}", what, hdf5_cause()));
}

Result<Hdf5SegmentReader> Hdf5SegmentReader::open(const std::filesystem::path& path,
                                                  const SegmentIdentity& identity) {
  if (const auto error = check_seal(path)) {
    return Error{fmt::format("{}; {}", error->message, identity.remedy)};
  }
  silence_hdf5();
  const Hdf5Handle access(H5Pcreate(H5P_FILE_ACCESS), H5Pclose);
  // Some network file systems cannot lock, and a finished segment never changes.
  if (access.ok()) H5Pset_file_locking(access.id(), false, true);
  Hdf5Handle file(H5Fopen(path.c_str(), H5F_ACC_RDONLY, access.ok() ? access.id() : H5P_DEFAULT),
                  H5Fclose);
  if (!file.ok()) {
    return Error{fmt::format("{}: HDF5 cannot open it: {}; {}", path.string(), hdf5_cause(),
                             identity.remedy)};
  }
  Hdf5SegmentReader reader(path, std::move(file), identity.remedy);
  if (const auto error = reader.check_header(identity)) return *error;
  return reader;
}

Result<std::int32_t> Hdf5SegmentReader::version_attribute() const {
  const Hdf5Handle attribute(H5Aopen(file_.id(), "format_version", H5P_DEFAULT), H5Aclose);
  std::int32_t version = 0;
  if (!attribute.ok() || H5Aget_storage_size(attribute.id()) != sizeof(version) ||
      H5Aread(attribute.id(), H5T_NATIVE_INT32, &version) < 0) {
    return refused("it has no format version");
  }
  return version;
}

Result<std::string> Hdf5SegmentReader::text(const char* name, std::size_t limit_bytes) const {
  if (H5Aexists(file_.id(), name) == 0) return std::string();
  const Hdf5Handle attribute(H5Aopen(file_.id(), name, H5P_DEFAULT), H5Aclose);
  if (!attribute.ok()) return refused(fmt::format("its attribute `{}` cannot be read", name));
  const Hdf5Handle type(H5Aget_type(attribute.id()), H5Tclose);
  const hsize_t size_bytes = H5Aget_storage_size(attribute.id());
  if (!type.ok() || H5Tget_class(type.id()) != H5T_STRING || size_bytes > limit_bytes ||
      H5Tis_variable_str(type.id()) != 0) {
    return refused(fmt::format("its attribute `{}` is no text of ours", name));
  }
  std::string text(size_bytes, '\0');
  if (H5Aread(attribute.id(), type.id(), text.data()) < 0) {
    return refused(fmt::format("its attribute `{}` cannot be read", name));
  }
  return text;
}

std::optional<Error> Hdf5SegmentReader::check_header(const SegmentIdentity& identity) const {
  const auto version = version_attribute();
  if (!version) return version.error();
  const auto value = text(identity.attribute, kMostIdentityBytes);
  if (!value) return value.error();
  if (value->empty()) return refused(fmt::format("it names no {}", identity.called));
  if (*value != identity.value) {
    return refused(fmt::format("its {} is {}, {} is {}", identity.called, *value,
                               identity.wanted_by, identity.value));
  }
  if (*version != identity.format_version) {
    return refused(fmt::format("its format version is {}, this program reads {}", *version,
                               identity.format_version));
  }
  return std::nullopt;
}

template <class T>
Result<std::vector<T>> Hdf5SegmentReader::values(const char* name, std::size_t columns,
                                                 std::size_t limit_rows) const {
  const Hdf5Handle data(H5Dopen2(file_.id(), name, H5P_DEFAULT), H5Dclose);
  if (!data.ok()) return refused_by_hdf5(dataset_named(name));
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  const int dimensions = columns > 1 ? 2 : 1;
  if (!space.ok() || H5Sget_simple_extent_ndims(space.id()) != dimensions) {
    return refused_shape(name);
  }
  std::array<hsize_t, 2> shape = {0, 1};
  H5Sget_simple_extent_dims(space.id(), shape.data(), nullptr);
  if (shape[0] < 1 || shape[0] > limit_rows || shape[1] != columns) return refused_shape(name);
  std::vector<T> values(shape[0] * columns);
  if (H5Dread(data.id(), memory_type_of<T>(), H5S_ALL, H5S_ALL, H5P_DEFAULT, values.data()) < 0) {
    return refused_by_hdf5(dataset_named(name));
  }
  return values;
}

template Result<std::vector<std::int32_t>> Hdf5SegmentReader::values(const char*, std::size_t,
                                                                     std::size_t) const;
template Result<std::vector<std::uint8_t>> Hdf5SegmentReader::values(const char*, std::size_t,
                                                                     std::size_t) const;
template Result<std::vector<std::uint64_t>> Hdf5SegmentReader::values(const char*, std::size_t,
                                                                      std::size_t) const;
template Result<std::vector<double>> Hdf5SegmentReader::values(const char*, std::size_t,
                                                               std::size_t) const;

std::optional<Error> Hdf5SegmentReader::read_shapes(const Hdf5Handle& data, const std::string& what,
                                                    ChunkedDataset& dataset) const {
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  const Hdf5Handle creation(H5Dget_create_plist(data.id()), H5Pclose);
  const Hdf5Handle type(H5Dget_type(data.id()), H5Tclose);
  if (!space.ok() || !creation.ok() || !type.ok()) return refused_by_hdf5(what);
  const int rank = H5Sget_simple_extent_ndims(space.id());
  if (rank < 1 || rank > static_cast<int>(kMostDimensions) ||
      H5Pget_layout(creation.id()) != H5D_CHUNKED) {
    return refused(what + " has another shape than it should");
  }
  std::array<hsize_t, kMostDimensions> shape = {};
  std::array<hsize_t, kMostDimensions> chunk = {};
  if (H5Sget_simple_extent_dims(space.id(), shape.data(), nullptr) < 0 ||
      H5Pget_chunk(creation.id(), static_cast<int>(kMostDimensions), chunk.data()) != rank) {
    return refused_by_hdf5(what);
  }
  dataset.shape.assign(shape.begin(), shape.begin() + rank);
  dataset.chunk_shape.assign(chunk.begin(), chunk.begin() + rank);
  dataset.element_bytes = H5Tget_size(type.id());
  return std::nullopt;
}

Result<ChunkedDataset> Hdf5SegmentReader::chunked(const char* name, std::size_t limit_chunks,
                                                  std::size_t limit_bytes) const {
  const std::string what = dataset_named(name);
  const Hdf5Handle data(H5Dopen2(file_.id(), name, H5P_DEFAULT), H5Dclose);
  if (!data.ok()) return refused_by_hdf5(what);
  ChunkedDataset dataset;
  if (const auto error = read_shapes(data, what, dataset)) return *error;
  const Hdf5Handle space(H5Dget_space(data.id()), H5Sclose);
  hsize_t count = 0;
  if (!space.ok() || H5Dget_num_chunks(data.id(), space.id(), &count) < 0) {
    return refused_by_hdf5(what);
  }
  if (count > limit_chunks) return refused(fmt::format("{} has {} chunks", what, count));
  for (hsize_t k = 0; k < count; ++k) {
    std::array<hsize_t, kMostDimensions> at = {};
    unsigned mask = 0;
    haddr_t address = 0;
    hsize_t bytes = 0;
    if (H5Dget_chunk_info(data.id(), space.id(), k, at.data(), &mask, &address, &bytes) < 0) {
      return refused_by_hdf5(what);
    }
    if (mask != 0 || bytes > limit_bytes) {
      return refused(fmt::format("chunk {} of `{}` is none of qmpipe's", k, name));
    }
    dataset.chunks.push_back({.row = at[0], .range = {.offset = address, .bytes = bytes}});
  }
  return dataset;
}

}  // namespace qmpipe
