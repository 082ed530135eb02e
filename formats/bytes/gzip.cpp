#include "formats/bytes/gzip.h"

#include <fmt/format.h>
#include <libdeflate.h>

#include <algorithm>
#include <new>

#include "formats/bytes/little_endian.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Header of 10 and trailer of 8 bytes.
constexpr std::size_t kSmallestMemberBytes = 18;
// DEFLATE's best ratio is 1032 : 1; what claims more cannot be had from these bytes.
constexpr std::size_t kBestRatio = 1032;

struct FreeCompressor {
  void operator()(libdeflate_compressor* c) const { libdeflate_free_compressor(c); }
};
struct FreeDecompressor {
  void operator()(libdeflate_decompressor* d) const { libdeflate_free_decompressor(d); }
};

// Last four bytes: the plain size modulo 2^32, if there is one member only.
std::size_t claimed_size_bytes(std::span<const std::uint8_t> packed) {
  return load_little_endian<std::uint32_t>(packed.data() + packed.size() - 4);
}

std::size_t largest_size_bytes(std::size_t packed_bytes, std::size_t limit_bytes) {
  if (packed_bytes > limit_bytes / kBestRatio) return limit_bytes;
  return packed_bytes * kBestRatio;
}

}  // namespace

struct GzipCompressor::Impl {
  std::unique_ptr<libdeflate_compressor, FreeCompressor> compressor;
};

GzipCompressor::GzipCompressor(int level) : impl_(std::make_unique<Impl>()) {
  QMPIPE_CHECK(level >= 1 && level <= 12);
  impl_->compressor.reset(libdeflate_alloc_compressor(level));
  if (!impl_->compressor) throw std::bad_alloc();
}

GzipCompressor::~GzipCompressor() = default;
GzipCompressor::GzipCompressor(GzipCompressor&&) noexcept = default;
GzipCompressor& GzipCompressor::operator=(GzipCompressor&&) noexcept = default;

std::vector<std::uint8_t> GzipCompressor::compress(std::span<const std::uint8_t> plain) {
  libdeflate_compressor* const compressor = impl_->compressor.get();
  std::vector<std::uint8_t> packed(libdeflate_gzip_compress_bound(compressor, plain.size()));
  const std::size_t size = libdeflate_gzip_compress(compressor, plain.data(), plain.size(),
                                                    packed.data(), packed.size());
  QMPIPE_CHECK(size > 0);
  packed.resize(size);
  return packed;
}

std::vector<std::uint8_t> gzip_compress(std::span<const std::uint8_t> plain, int level) {
  return GzipCompressor(level).compress(plain);
}

bool is_gzip(std::span<const std::uint8_t> bytes) {
  // Two bytes alone would take one plain tile in 65,536 for gzip: a tile begins with a coordinate.
  constexpr std::uint8_t kReservedFlags = 0xE0;
  return bytes.size() >= 4 && bytes[0] == 0x1F && bytes[1] == 0x8B && bytes[2] == 8 &&
         (bytes[3] & kReservedFlags) == 0;
}

Result<std::vector<std::uint8_t>> gzip_decompress(std::span<const std::uint8_t> packed,
                                                  std::size_t limit_bytes) {
  if (!is_gzip(packed)) return Error{"the data is not gzip"};
  if (packed.size() < kSmallestMemberBytes) {
    return Error{fmt::format("the gzip data ends after {} bytes", packed.size())};
  }
  const std::unique_ptr<libdeflate_decompressor, FreeDecompressor> decompressor(
      libdeflate_alloc_decompressor());
  if (!decompressor) throw std::bad_alloc();

  const std::size_t largest = largest_size_bytes(packed.size(), limit_bytes);
  std::vector<std::uint8_t> plain(std::clamp<std::size_t>(
      claimed_size_bytes(packed), std::min<std::size_t>(1, largest), largest));
  while (true) {
    std::size_t used_bytes = 0;
    std::size_t plain_bytes = 0;
    const libdeflate_result result =
        libdeflate_gzip_decompress_ex(decompressor.get(), packed.data(), packed.size(),
                                      plain.data(), plain.size(), &used_bytes, &plain_bytes);
    if (result == LIBDEFLATE_SUCCESS) {
      if (used_bytes != packed.size()) {
        return Error{fmt::format("{} bytes follow the gzip data", packed.size() - used_bytes)};
      }
      plain.resize(plain_bytes);
      return plain;
    }
    if (result != LIBDEFLATE_INSUFFICIENT_SPACE) {
      return Error{"the gzip data is damaged or truncated"};
    }
    if (plain.size() == limit_bytes) {
      return Error{fmt::format("the gzip data holds more than {} bytes", limit_bytes)};
    }
    if (plain.size() == largest) return Error{"the gzip data is damaged or truncated"};
    // A wrong claim: from the start again with more room; assign() so that nothing is copied.
    plain.assign(plain.size() > largest / 2 ? largest : plain.size() * 2, 0);
  }
}

}  // namespace qmpipe
