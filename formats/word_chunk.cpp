#include "formats/word_chunk.h"

#include <fmt/format.h>
#include <zstd.h>

#include <new>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kWordBytes = sizeof(std::uint32_t);

}  // namespace

std::size_t largest_word_chunk_bytes() { return ZSTD_compressBound(kMaxChunkWords * kWordBytes); }

std::vector<std::uint8_t> pack_words(std::span<const std::uint32_t> words, std::size_t chunk_words,
                                     int level) {
  QMPIPE_CHECK(!words.empty() && words.size() <= chunk_words && chunk_words <= kMaxChunkWords);
  std::vector<std::uint8_t> planes(chunk_words * kWordBytes);
  for (std::size_t k = 0; k < kWordBytes; ++k) {
    std::uint8_t* plane = planes.data() + k * chunk_words;
    for (std::size_t n = 0; n < words.size(); ++n) {
      plane[n] = static_cast<std::uint8_t>(words[n] >> (8 * k));
    }
  }
  std::vector<std::uint8_t> chunk(ZSTD_compressBound(planes.size()));
  const std::size_t packed_bytes =
      ZSTD_compress(chunk.data(), chunk.size(), planes.data(), planes.size(), level);
  if (ZSTD_isError(packed_bytes) != 0) throw std::bad_alloc();
  chunk.resize(packed_bytes);
  return chunk;
}

Result<std::vector<std::uint32_t>> unpack_words(std::span<const std::uint8_t> chunk,
                                                std::size_t count, std::size_t chunk_words) {
  QMPIPE_CHECK(count >= 1 && count <= chunk_words && chunk_words <= kMaxChunkWords);
  std::vector<std::uint8_t> planes(chunk_words * kWordBytes);
  const std::size_t plain_bytes =
      ZSTD_decompress(planes.data(), planes.size(), chunk.data(), chunk.size());
  if (ZSTD_isError(plain_bytes) != 0) {
    return Error{fmt::format("it does not decompress: {}", ZSTD_getErrorName(plain_bytes))};
  }
  if (plain_bytes != planes.size()) {
    return Error{fmt::format("it holds {} bytes instead of {}", plain_bytes, planes.size())};
  }
  std::vector<std::uint32_t> words(count);
  for (std::size_t k = 0; k < kWordBytes; ++k) {
    const std::uint8_t* plane = planes.data() + k * chunk_words;
    for (std::size_t n = 0; n < count; ++n) {
      words[n] |= static_cast<std::uint32_t>(plane[n]) << (8 * k);
    }
  }
  return words;
}

}  // namespace qmpipe
