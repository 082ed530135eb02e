// Any bytes as the arrays of a detail-increment model: decode_detail() neither throws nor
// over-reads, and what it accepts encodes to the same arrays. The first byte says how many blocks
// there are and whether the words come through unpack_words(), then come three bytes a block
// (coarse points, coarse triangles, splits), one for the seams, and the words, 0 where they end.
#include <algorithm>
#include <cstdint>
#include <cstdlib>
#include <span>

#include "formats/bytes/little_endian.h"
#include "formats/detail_model/arrays.h"
#include "formats/hdf5/word_chunk.h"

namespace {

using Bytes = std::span<const std::uint8_t>;

std::vector<std::uint32_t> words_of(Bytes bytes, std::size_t count, bool is_packed) {
  if (is_packed && count > 0) {
    const auto words = qmpipe::unpack_words(bytes, count, count);
    if (words.ok()) return *words;
  }
  std::vector<std::uint32_t> words(count);
  for (std::size_t k = 0; k < std::min(count, bytes.size() / 4); ++k) {
    words[k] = qmpipe::load_little_endian<std::uint32_t>(bytes.data() + 4 * k);
  }
  return words;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Bytes bytes(data, size);
  if (bytes.empty()) return 0;
  const std::size_t blocks = 1 + bytes[0] % 4;
  const bool is_packed = bytes[0] >= 128;
  if (bytes.size() < 2 + 3 * blocks) return 0;
  qmpipe::DetailSummary summary;
  for (std::size_t b = 0; b < blocks; ++b) {
    const Bytes counts = bytes.subspan(1 + 3 * b, 3);
    summary.blocks.push_back({counts[0], counts[1], counts[2]});
  }
  summary.seams = bytes[1 + 3 * blocks];
  const auto lengths = qmpipe::array_lengths(summary);
  std::size_t total = 0;
  for (const std::uint64_t length : lengths) total += length;
  const auto words = words_of(bytes.subspan(2 + 3 * blocks), total, is_packed);
  qmpipe::DetailArrays arrays;
  std::size_t at = 0;
  for (std::size_t k = 0; k < arrays.size(); ++k) {
    const auto part = std::span(words).subspan(at, lengths[k]);
    arrays[k].assign(part.begin(), part.end());
    at += lengths[k];
  }
  const auto model = qmpipe::decode_detail(summary, arrays);
  if (model.ok() && qmpipe::encode_detail(*model) != arrays) std::abort();
  return 0;
}
