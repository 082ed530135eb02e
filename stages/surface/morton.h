// A place on a curve that fills the plane: neighbours on it are neighbours in the plane, mostly.
#pragma once

#include <cstdint>

namespace qmpipe {

// The bits of x and y in turn.
constexpr std::uint64_t morton_code(std::uint32_t x, std::uint32_t y) {
  const auto spread = [](std::uint64_t bits) {
    bits = (bits | bits << 16U) & 0x0000FFFF0000FFFFULL;
    bits = (bits | bits << 8U) & 0x00FF00FF00FF00FFULL;
    bits = (bits | bits << 4U) & 0x0F0F0F0F0F0F0F0FULL;
    bits = (bits | bits << 2U) & 0x3333333333333333ULL;
    return (bits | bits << 1U) & 0x5555555555555555ULL;
  };
  return spread(x) | spread(y) << 1U;
}

}  // namespace qmpipe
