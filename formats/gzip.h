// Gzip members, through libdeflate. The header carries no time and no name, so equal input gives
// equal bytes (for one version of libdeflate).
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/result.h"

namespace qmpipe {

// level: 1 (fast) .. 12 (small).
std::vector<std::uint8_t> gzip_compress(std::span<const std::uint8_t> plain, int level);

bool is_gzip(std::span<const std::uint8_t> bytes);

// Refuses damaged data and anything that would grow past limit_bytes.
Result<std::vector<std::uint8_t>> gzip_decompress(std::span<const std::uint8_t> packed,
                                                  std::size_t limit_bytes);

}  // namespace qmpipe
