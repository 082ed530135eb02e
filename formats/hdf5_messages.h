// The messages of HDF5's object headers, for hdf5_structure.cpp (HDF5 File Format Specification,
// section IV.A.2). Nothing here reads past the bytes it is given.
#pragma once

#include <cstddef>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/hdf5_structure.h"
#include "formats/little_endian.h"
#include "formats/result.h"

namespace qmpipe {

// The address of what is not there.
inline constexpr std::uint64_t kNoAddress = std::numeric_limits<std::uint64_t>::max();
inline constexpr std::size_t kMostHdf5Dimensions = 4;

// Numbers one after the other; past the end they are 0 and failed() says so.
class ByteCursor {
 public:
  explicit ByteCursor(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  std::uint8_t u8() { return number<std::uint8_t>(); }
  std::uint16_t u16() { return number<std::uint16_t>(); }
  std::uint32_t u32() { return number<std::uint32_t>(); }
  std::uint64_t u64() { return number<std::uint64_t>(); }
  void skip(std::size_t count) { take(count); }
  std::span<const std::uint8_t> take(std::size_t count) {
    if (count > bytes_.size()) {
      failed_ = true;
      count = bytes_.size();
    }
    const auto taken = bytes_.first(count);
    bytes_ = bytes_.subspan(count);
    return taken;
  }
  std::size_t left() const { return bytes_.size(); }
  bool failed() const { return failed_; }

 private:
  template <class T>
  T number() {
    const auto taken = take(sizeof(T));
    return taken.size() == sizeof(T) ? load_little_endian<T>(taken.data()) : T{0};
  }

  std::span<const std::uint8_t> bytes_;
  bool failed_ = false;
};

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
