// Blocks of heights to compressed chunks and back, in the bytes that HDF5's filters would make:
// its byte shuffle (filter 2), then one zstd frame (registered filter 32015).
#pragma once

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// Keeps zstd's working memory between calls, one set for each call under way. Safe to use from
// several threads at once.
class BlockCodec {
 public:
  // zstd's level. REQUIRES: 1 .. 19.
  explicit BlockCodec(int level);
  ~BlockCodec();
  BlockCodec(const BlockCodec&) = delete;
  BlockCodec& operator=(const BlockCodec&) = delete;

  // REQUIRES: heights_m.size() == 256 * 256.
  std::vector<std::uint8_t> compress(std::span<const float> heights_m) const;
  // Refuses anything but a whole chunk of 256 * 256 heights.
  Result<std::vector<float>> decompress(std::span<const std::uint8_t> chunk) const;

  // No chunk is larger.
  static std::size_t largest_chunk_bytes();

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
