#include "formats/hdf5/messages.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace qmpipe {
namespace {

constexpr std::size_t kTypePrefixBytes = 8;

struct Dataspace {
  std::vector<std::uint64_t> shape;  // empty: one value
};

std::size_t padded(std::size_t bytes) { return (bytes + 7) / 8 * 8; }

Result<Dataspace> parse_dataspace(std::span<const std::uint8_t> bytes) {
  ByteCursor cursor(bytes);
  const std::uint8_t version = cursor.u8();
  const std::size_t rank = cursor.u8();
  cursor.skip(1 + 1 + 4);  // whether sizes of growing dimensions follow; reserved
  if (version != 1 || rank > kMostHdf5Dimensions) return Error{"its shape is none of qmpipe's"};
  Dataspace space;
  for (std::size_t d = 0; d < rank; ++d) space.shape.push_back(cursor.u64());
  if (cursor.failed()) return Error{"its shape is cut off"};
  return space;
}

std::uint64_t element_bytes_of(const Hdf5Type& type) {
  return load_little_endian<std::uint32_t>(type.data() + 4);
}

Result<Hdf5Type> parse_type(std::span<const std::uint8_t> bytes) {
  Hdf5Type type(bytes.begin(), bytes.end());
  if (type.size() < kTypePrefixBytes || element_bytes_of(type) == 0) {
    return Error{"its type is cut off"};
  }
  return type;
}

// Elements of one type; none where there are more bytes than can be counted.
std::optional<std::uint64_t> total_bytes(const std::vector<std::uint64_t>& shape,
                                         std::uint64_t element_bytes) {
  std::uint64_t bytes = element_bytes;
  for (const std::uint64_t size : shape) {
    if (__builtin_mul_overflow(bytes, size, &bytes)) return std::nullopt;
  }
  return bytes;
}

std::optional<Error> parse_layout(std::span<const std::uint8_t> bytes, Hdf5Dataset& dataset) {
  constexpr std::uint8_t kVersion = 3;
  constexpr std::uint8_t kContiguous = 1;
  constexpr std::uint8_t kChunked = 2;
  ByteCursor cursor(bytes);
  const std::uint8_t version = cursor.u8();
  const std::uint8_t layout = cursor.u8();
  if (version != kVersion || (layout != kContiguous && layout != kChunked)) {
    return Error{"its values are laid out as qmpipe never does"};
  }
  dataset.is_chunked = layout == kChunked;
  if (dataset.is_chunked) {
    // One more than the dataset's: the bytes of an element.
    const std::size_t rank = cursor.u8();
    dataset.chunk_index = cursor.u64();
    if (rank < 2 || rank > kMostHdf5Dimensions + 1) return Error{"its chunks have no shape"};
    for (std::size_t d = 0; d + 1 < rank; ++d) dataset.chunk_shape.push_back(cursor.u32());
    dataset.element_bytes = cursor.u32();
  } else {
    dataset.values.offset = cursor.u64();
    dataset.values.bytes = cursor.u64();
  }
  if (cursor.failed()) return Error{"its layout is cut off"};
  return std::nullopt;
}

std::optional<Error> parse_filters(std::span<const std::uint8_t> bytes, Hdf5Dataset& dataset) {
  ByteCursor cursor(bytes);
  const std::uint8_t version = cursor.u8();
  const std::size_t count = cursor.u8();
  cursor.skip(6);
  if (version != 1) return Error{"its filters are of another version"};
  for (std::size_t k = 0; k < count; ++k) {
    dataset.filters.push_back(cursor.u16());
    const std::size_t name_bytes = cursor.u16();
    cursor.skip(2);
    const std::size_t values = cursor.u16();
    cursor.skip(padded(name_bytes));
    cursor.skip(4 * (values + values % 2));
  }
  if (cursor.failed()) return Error{"its filters are cut off"};
  return std::nullopt;
}

std::optional<Error> parse_message(const Hdf5Message& message, Hdf5Dataset& dataset) {
  switch (message.type) {
    case Hdf5MessageType::kDataspace: {
      auto space = parse_dataspace(message.bytes);
      if (!space) return space.error();
      dataset.shape = std::move(space->shape);
      return std::nullopt;
    }
    case Hdf5MessageType::kDatatype: {
      auto type = parse_type(message.bytes);
      if (!type) return type.error();
      dataset.type = std::move(*type);
      return std::nullopt;
    }
    case Hdf5MessageType::kExternalFiles:
      return Error{"its values are in other files"};
    case Hdf5MessageType::kLayout:
      return parse_layout(message.bytes, dataset);
    case Hdf5MessageType::kFilters:
      return parse_filters(message.bytes, dataset);
    case Hdf5MessageType::kAttribute:
    case Hdf5MessageType::kContinuation:
    case Hdf5MessageType::kSymbolTable:
      return std::nullopt;
  }
  return std::nullopt;  // the fill value, the time and others that say nothing about the values
}

bool has_twice(const std::vector<Hdf5Message>& messages, Hdf5MessageType type) {
  return std::count_if(messages.begin(), messages.end(),
                       [type](const Hdf5Message& message) { return message.type == type; }) > 1;
}

}  // namespace

Result<std::pair<std::string, Hdf5Attribute>> parse_attribute(std::span<const std::uint8_t> bytes) {
  ByteCursor cursor(bytes);
  const std::uint16_t version = cursor.u16();
  const std::size_t name_bytes = cursor.u16();
  const std::size_t type_bytes = cursor.u16();
  const std::size_t space_bytes = cursor.u16();
  const auto name = cursor.take(padded(name_bytes));
  const auto type = parse_type(cursor.take(padded(type_bytes)));
  const auto space = parse_dataspace(cursor.take(padded(space_bytes)));
  if (version != 1 || cursor.failed() || !type || !space) {
    return Error{"an attribute is none of qmpipe's"};
  }
  const auto value = cursor.take(cursor.left());
  const auto value_bytes = total_bytes(space->shape, element_bytes_of(*type));
  if (!value_bytes || *value_bytes > value.size()) return Error{"an attribute is cut off"};
  Hdf5Attribute attribute = {
      .type = *type,
      .is_scalar = space->shape.empty(),
      .value = {value.begin(), value.begin() + static_cast<std::ptrdiff_t>(*value_bytes)}};
  return std::pair(std::string(name.begin(), std::find(name.begin(), name.end(), std::uint8_t{0})),
                   std::move(attribute));
}

Result<SymbolTable> parse_symbol_table(std::span<const std::uint8_t> bytes) {
  ByteCursor cursor(bytes);
  const std::uint64_t tree = cursor.u64();
  const SymbolTable table = {.tree = tree, .heap = cursor.u64()};
  if (cursor.failed()) return Error{"its list of names is cut off"};
  return table;
}

Result<Hdf5Dataset> parse_dataset(const std::vector<Hdf5Message>& messages) {
  for (const auto type : {Hdf5MessageType::kDataspace, Hdf5MessageType::kDatatype,
                          Hdf5MessageType::kLayout, Hdf5MessageType::kFilters}) {
    if (has_twice(messages, type)) return Error{"it says twice what its values are"};
  }
  Hdf5Dataset dataset;
  for (const Hdf5Message& message : messages) {
    if (const auto error = parse_message(message, dataset)) return *error;
  }
  if (dataset.type.empty() || dataset.shape.empty()) return Error{"it has no type or no shape"};
  const std::uint64_t element_bytes = element_bytes_of(dataset.type);
  if (dataset.is_chunked) {
    if (dataset.chunk_shape.size() != dataset.shape.size() ||
        dataset.element_bytes != element_bytes) {
      return Error{"its chunks have another shape or type than it has"};
    }
    return dataset;
  }
  dataset.element_bytes = element_bytes;
  if (total_bytes(dataset.shape, element_bytes) != dataset.values.bytes ||
      !dataset.filters.empty()) {
    return Error{"its values are not as many as its shape says, or filtered"};
  }
  return dataset;
}

}  // namespace qmpipe
