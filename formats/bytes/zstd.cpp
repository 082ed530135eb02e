#include "formats/bytes/zstd.h"

#include <fmt/format.h>
#include <zstd.h>

#include <new>

namespace qmpipe {

std::size_t largest_zstd_bytes(std::size_t plain_bytes) { return ZSTD_compressBound(plain_bytes); }

std::vector<std::uint8_t> zstd_pack(std::span<const std::uint8_t> plain, int level) {
  std::vector<std::uint8_t> packed(largest_zstd_bytes(plain.size()));
  const std::size_t bytes =
      ZSTD_compress(packed.data(), packed.size(), plain.data(), plain.size(), level);
  // With room for the worst case only memory can be short.
  if (ZSTD_isError(bytes) != 0) throw std::bad_alloc();
  packed.resize(bytes);
  return packed;
}

Result<std::vector<std::uint8_t>> zstd_unpack(std::span<const std::uint8_t> packed,
                                              std::size_t plain_bytes) {
  std::vector<std::uint8_t> plain(plain_bytes);
  const std::size_t bytes =
      ZSTD_decompress(plain.data(), plain.size(), packed.data(), packed.size());
  if (ZSTD_isError(bytes) != 0) {
    return Error{fmt::format("it does not decompress: {}", ZSTD_getErrorName(bytes))};
  }
  if (bytes != plain_bytes) {
    return Error{fmt::format("it holds {} bytes instead of {}", bytes, plain_bytes)};
  }
  return plain;
}

}  // namespace qmpipe
