// The messages of HDF5's object headers, for formats/hdf5/structure.cpp (HDF5 File Format Specification,
// section IV.A.2). Nothing here reads past the bytes it is given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/bytes/byte_cursor.h"
#include "formats/bytes/result.h"
#include "formats/hdf5/structure.h"

namespace qmpipe {

// The address of what is not there.
inline constexpr std::uint64_t kNoAddress = std::numeric_limits<std::uint64_t>::max();
inline constexpr std::size_t kMostHdf5Dimensions = 4;

enum class Hdf5MessageType : std::uint16_t {
  kDataspace = 0x1,
  kDatatype = 0x3,
  kExternalFiles = 0x7,
  kLayout = 0x8,
  kFilters = 0xB,
  kAttribute = 0xC,
  kContinuation = 0x10,
  kSymbolTable = 0x11,
};

struct Hdf5Message {
  Hdf5MessageType type{};
  std::vector<std::uint8_t> bytes;
};

// Where a group's names are.
struct SymbolTable {
  std::uint64_t tree = 0;
  std::uint64_t heap = 0;
};

Result<std::pair<std::string, Hdf5Attribute>> parse_attribute(std::span<const std::uint8_t> bytes);
Result<SymbolTable> parse_symbol_table(std::span<const std::uint8_t> bytes);
// Refuses a dataset whose values are in other files, or that says one thing twice.
Result<Hdf5Dataset> parse_dataset(const std::vector<Hdf5Message>& messages);

}  // namespace qmpipe
