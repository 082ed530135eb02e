// Numbers as little-endian bytes, whatever the host's order; no alignment is needed.
#pragma once

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <cstring>
#include <type_traits>
#include <vector>

namespace qmpipe {

// REQUIRES: sizeof(T) writable bytes at `to`.
template <class T>
requires std::is_arithmetic_v<T>
void store_little_endian(std::uint8_t* to, T value) {
  std::memcpy(to, &value, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) std::reverse(to, to + sizeof(T));
}

template <class T>
requires std::is_arithmetic_v<T>
void append_little_endian(std::vector<std::uint8_t>& bytes, T value) {
  bytes.resize(bytes.size() + sizeof(T));
  store_little_endian(bytes.data() + bytes.size() - sizeof(T), value);
}

// REQUIRES: sizeof(T) readable bytes at `from`.
template <class T>
requires std::is_arithmetic_v<T> T load_little_endian(const std::uint8_t* from) {
  std::array<std::uint8_t, sizeof(T)> bytes{};
  std::memcpy(bytes.data(), from, sizeof(T));
  if constexpr (std::endian::native == std::endian::big) std::reverse(bytes.begin(), bytes.end());
  return std::bit_cast<T>(bytes);
}

}  // namespace qmpipe
