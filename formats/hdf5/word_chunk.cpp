#include "formats/hdf5/word_chunk.h"

#include "formats/bytes/zstd.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kWordBytes = sizeof(std::uint32_t);

}  // namespace

std::size_t largest_word_chunk_bytes() { return largest_zstd_bytes(kMaxChunkWords * kWordBytes); }

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
  return zstd_pack(planes, level);
}

Result<std::vector<std::uint32_t>> unpack_words(std::span<const std::uint8_t> chunk,
                                                std::size_t count, std::size_t chunk_words) {
  QMPIPE_CHECK(count >= 1 && count <= chunk_words && chunk_words <= kMaxChunkWords);
  const auto planes = zstd_unpack(chunk, chunk_words * kWordBytes);
  if (!planes) return planes.error();
  std::vector<std::uint32_t> words(count);
  for (std::size_t k = 0; k < kWordBytes; ++k) {
    const std::uint8_t* plane = planes->data() + k * chunk_words;
    for (std::size_t n = 0; n < count; ++n) {
      words[n] |= static_cast<std::uint32_t>(plane[n]) << (8 * k);
    }
  }
  return words;
}

}  // namespace qmpipe
