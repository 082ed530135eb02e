#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <type_traits>

#include "formats/bytes/little_endian.h"
#include "formats/hdf5/segment.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostIdentityBytes = 64;
constexpr std::uint16_t kShuffleFilter = 2;

// As HDF5 writes its little-endian standard types: class and version, bits (order, padding, sign),
// size; then offset and bits of the number, and what a floating-point one is made of.
template <class T>
Hdf5Type type_of() {
  if constexpr (std::is_same_v<T, std::int32_t>) return {0x10, 8, 0, 0, 4, 0, 0, 0, 0, 0, 32, 0};
  if constexpr (std::is_same_v<T, std::uint8_t>) return {0x10, 0, 0, 0, 1, 0, 0, 0, 0, 0, 8, 0};
  if constexpr (std::is_same_v<T, double>) {
    return {0x11, 0x20, 0x3F, 0, 8, 0, 0, 0, 0, 0, 64, 0, 52, 11, 0, 52, 0xFF, 3, 0, 0};
  }
  return {0x10, 0, 0, 0, 8, 0, 0, 0, 0, 0, 64, 0};
}

// Its message is padded.
template <class T>
bool is_of_type(const Hdf5Type& type) {
  const Hdf5Type wanted = type_of<T>();
  return type.size() >= wanted.size() && std::equal(wanted.begin(), wanted.end(), type.begin());
}

bool is_text(const Hdf5Type& type) {
  constexpr std::uint8_t kText = 0x13;
  return type.front() == kText;
}

std::string dataset_named(const std::string& name) { return fmt::format("the dataset `{}`", name); }

}  // namespace

Error Hdf5SegmentReader::refused(const std::string& cause) const {
  return Error{fmt::format("{}: {}; {}", path_.string(), cause, remedy_)};
}

Error Hdf5SegmentReader::refused_shape(const std::string& name) const {
  return refused(dataset_named(name) + " has another shape than it should");
}

Error Hdf5SegmentReader::refused_unread(const std::string& what, const Error& cause) const {
  return refused(fmt::format("{} cannot be read: {}", what, cause.message));
}

Result<Hdf5SegmentReader> Hdf5SegmentReader::open(const std::filesystem::path& path,
                                                  const SegmentIdentity& identity) {
  if (const auto error = check_seal(path)) {
    return Error{fmt::format("{}; {}", error->message, identity.remedy)};
  }
  auto structure = Hdf5Structure::read(path);
  if (!structure) {
    return Error{
        fmt::format("{}: {}; {}", path.string(), structure.error().message, identity.remedy)};
  }
  Hdf5SegmentReader reader(path, std::move(*structure), identity.remedy);
  if (const auto error = reader.check_header(identity)) return *error;
  return reader;
}

Result<std::int32_t> Hdf5SegmentReader::version_attribute() const {
  const Hdf5Attribute* attribute = structure_.attribute("format_version");
  if (attribute == nullptr || !attribute->is_scalar || !is_of_type<std::int32_t>(attribute->type)) {
    return refused("it has no format version");
  }
  return load_little_endian<std::int32_t>(attribute->value.data());
}

Result<std::string> Hdf5SegmentReader::text(const char* name, std::size_t limit_bytes) const {
  const Hdf5Attribute* attribute = structure_.attribute(name);
  if (attribute == nullptr) return std::string();
  if (!attribute->is_scalar || !is_text(attribute->type) || attribute->value.size() > limit_bytes) {
    return refused(fmt::format("its attribute `{}` is no text of ours", name));
  }
  return std::string(attribute->value.begin(), attribute->value.end());
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
  const auto data = structure_.dataset(name);
  if (!data) return refused_unread(dataset_named(name), data.error());
  const std::vector<std::uint64_t>& shape = data->shape;
  const bool has_rows = shape.size() == (columns > 1 ? 2U : 1U) && shape[0] >= 1 &&
                        shape[0] <= limit_rows && (columns == 1 || shape[1] == columns);
  if (!has_rows || data->is_chunked || !is_of_type<T>(data->type)) return refused_shape(name);
  const auto bytes = structure_.values_of(*data);
  if (!bytes) return refused_unread(dataset_named(name), bytes.error());
  std::vector<T> values(bytes->size() / sizeof(T));
  for (std::size_t k = 0; k < values.size(); ++k) {
    values[k] = load_little_endian<T>(bytes->data() + k * sizeof(T));
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

Result<ChunkedDataset> Hdf5SegmentReader::chunked(const char* name, std::size_t limit_chunks,
                                                  std::size_t limit_bytes) const {
  const std::string what = dataset_named(name);
  const auto data = structure_.dataset(name);
  if (!data) return refused_unread(what, data.error());
  if (!data->is_chunked ||
      data->filters != std::vector<std::uint16_t>{kShuffleFilter, kZstdFilter}) {
    return refused_shape(name);
  }
  auto chunks = structure_.chunks(*data, limit_chunks);
  if (!chunks) return refused_unread(what, chunks.error());
  for (std::size_t k = 0; k < chunks->size(); ++k) {
    if ((*chunks)[k].range.bytes <= limit_bytes) continue;
    return refused(fmt::format("chunk {} of `{}` is none of qmpipe's", k, name));
  }
  return ChunkedDataset{.shape = data->shape,
                        .chunk_shape = data->chunk_shape,
                        .element_bytes = data->element_bytes,
                        .chunks = std::move(*chunks)};
}

}  // namespace qmpipe
