// A 64-bit hash that finds damage in files of ours: not against an adversary.
//
// Guarantees: any change within one 8-byte word changes the hash for certain; any other change
// goes unnoticed with probability of about 2^-64. The same value on every machine, so it may be
// stored. Several pieces hash as one by passing the hash so far as the next seed.
#pragma once

#include <cstdint>
#include <cstring>
#include <span>

#include "formats/bytes/little_endian.h"

namespace qmpipe {

inline std::uint64_t hash64(std::span<const std::uint8_t> bytes, std::uint64_t seed) {
  // Every step can be undone, so states that once differ stay different.
  const auto mix = [](std::uint64_t state, std::uint64_t word) {
    state = (state ^ word) * 0x9E3779B97F4A7C15ULL;
    return state ^ (state >> 32U);
  };
  std::uint64_t state = mix(seed, bytes.size());
  while (bytes.size() >= sizeof(std::uint64_t)) {
    state = mix(state, load_little_endian<std::uint64_t>(bytes.data()));
    bytes = bytes.subspan(sizeof(std::uint64_t));
  }
  std::uint64_t last = 0;
  for (std::size_t k = 0; k < bytes.size(); ++k) {
    last |= static_cast<std::uint64_t>(bytes[k]) << (8 * k);
  }
  return mix(mix(state, last), 0);
}

}  // namespace qmpipe
