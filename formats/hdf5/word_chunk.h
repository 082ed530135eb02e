// Arrays of 32-bit words to compressed chunks and back, in the bytes that HDF5's filters would
// make: its byte shuffle (filter 2), then one zstd frame (registered filter 32015). Different
// threads may use these functions at once.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// No chunk has more words.
inline constexpr std::size_t kMaxChunkWords = 65536;

// A chunk of `chunk_words` words: those given, then zeros. `level` is zstd's. REQUIRES: 1 <=
// words.size() <= chunk_words <= kMaxChunkWords.
std::vector<std::uint8_t> pack_words(std::span<const std::uint32_t> words, std::size_t chunk_words,
                                     int level);

// The first `count` words of a chunk of `chunk_words`. Refuses anything but a whole chunk.
// REQUIRES: as for pack_words().
Result<std::vector<std::uint32_t>> unpack_words(std::span<const std::uint8_t> chunk,
                                                std::size_t count, std::size_t chunk_words);

// No chunk is larger.
std::size_t largest_word_chunk_bytes();

}  // namespace qmpipe
