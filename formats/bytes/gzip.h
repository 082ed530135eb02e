// Gzip members, through libdeflate. The header carries no time and no name, so equal input gives
// equal bytes (for one version of libdeflate).
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// Keeps the compressor's tables (hundreds of kB, up to some MB at high levels) between calls: one
// for each thread; a call may not run while another one does.
class GzipCompressor {
 public:
  // level: 1 (fast) .. 12 (small). REQUIRES: within that range.
  explicit GzipCompressor(int level);
  ~GzipCompressor();
  GzipCompressor(GzipCompressor&&) noexcept;
  GzipCompressor& operator=(GzipCompressor&&) noexcept;

  // One whole member. The result depends on `plain` and the level alone.
  std::vector<std::uint8_t> compress(std::span<const std::uint8_t> plain);

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

// For a single call; sets up a compressor and throws it away.
std::vector<std::uint8_t> gzip_compress(std::span<const std::uint8_t> plain, int level);

// By the first four bytes (RFC 1952: two fixed ones, the method 8, flags without reserved bits). One
// plain tile in 134 million looks so too.
bool is_gzip(std::span<const std::uint8_t> bytes);

// Accepts exactly one member. Refuses damaged data, anything after the member, and what would grow
// past limit_bytes. Memory stays below about 1100 times the packed size and limit_bytes, whatever
// the data says of itself.
Result<std::vector<std::uint8_t>> gzip_decompress(std::span<const std::uint8_t> packed,
                                                  std::size_t limit_bytes);

}  // namespace qmpipe
