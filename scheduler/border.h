// Borders: which posts of a tile's side are vertices, the one thing that neighbours must agree on.
// The heights come from the lattice, so 257 bits say all.
#pragma once

#include <array>
#include <bit>
#include <cstdint>

#include "scheduler/lattice.h"

namespace qmpipe {

// Position k is post k of the side, counted from the west (south, north sides) or from the south
// (west, east sides), corners included.
class BorderMask {
 public:
  void set(std::int32_t k) { words_[word(k)] |= bit(k); }
  bool test(std::int32_t k) const { return (words_[word(k)] & bit(k)) != 0; }
  std::int32_t count() const {
    std::int32_t n = 0;
    for (const std::uint64_t w : words_) n += std::popcount(w);
    return n;
  }
  friend bool operator==(const BorderMask&, const BorderMask&) = default;

 private:
  static std::size_t word(std::int32_t k) { return static_cast<std::size_t>(k) / 64; }
  static std::uint64_t bit(std::int32_t k) { return 1ULL << (static_cast<unsigned>(k) % 64); }
  std::array<std::uint64_t, 5> words_{};
};

// The post of a tile (0 <= i, j <= 256) at position k of a side.
constexpr Post side_post(Side side, std::int32_t k) {
  switch (side) {
    case Side::kWest:
      return {.i = 0, .j = k};
    case Side::kSouth:
      return {.i = k, .j = 0};
    case Side::kEast:
      return {.i = kTileIntervals, .j = k};
    case Side::kNorth:
      return {.i = k, .j = kTileIntervals};
  }
  return {};
}

}  // namespace qmpipe
