// Reads little-endian bytes from front to back and never past their end: for bytes from outside.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>

#include "formats/bytes/little_endian.h"

namespace qmpipe {

// Numbers one after the other; past the end they are 0 and failed() says so.
class ByteCursor {
 public:
  explicit ByteCursor(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  template <class T>
  T next() {
    const auto taken = take(sizeof(T));
    return taken.size() == sizeof(T) ? load_little_endian<T>(taken.data()) : T{0};
  }
  std::uint8_t u8() { return next<std::uint8_t>(); }
  std::uint16_t u16() { return next<std::uint16_t>(); }
  std::uint32_t u32() { return next<std::uint32_t>(); }
  std::uint64_t u64() { return next<std::uint64_t>(); }
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
  std::span<const std::uint8_t> bytes_;
  bool failed_ = false;
};

}  // namespace qmpipe
