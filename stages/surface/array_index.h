// Indices into arrays: ours are 32-bit and signed, where -1 says "none".
#pragma once

#include <cstddef>
#include <cstdint>

namespace qmpipe {

// REQUIRES: i >= 0.
constexpr std::size_t at(std::int32_t i) { return static_cast<std::size_t>(i); }

}  // namespace qmpipe
