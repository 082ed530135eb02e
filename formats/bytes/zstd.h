// Whole zstd frames for the chunks of HDF5 files, each with a known size.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// No more than this is made of so many bytes.
std::size_t largest_zstd_bytes(std::size_t plain_bytes);

// The result depends on the bytes, the level and zstd's version alone. Throws std::bad_alloc.
std::vector<std::uint8_t> zstd_pack(std::span<const std::uint8_t> plain, int level);

// Refuses damaged data and what does not hold exactly `plain_bytes`; no more is allocated.
Result<std::vector<std::uint8_t>> zstd_unpack(std::span<const std::uint8_t> packed,
                                              std::size_t plain_bytes);

}  // namespace qmpipe
