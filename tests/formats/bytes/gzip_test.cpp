#include "formats/bytes/gzip.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

namespace qmpipe::gzip_test {
namespace {

using ::testing::HasSubstr;
using Bytes = std::vector<std::uint8_t>;

constexpr std::size_t kPlenty = std::size_t{1} << 24U;

Bytes random_bytes(std::mt19937_64& random, std::size_t size, unsigned values) {
  Bytes bytes(size);
  for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random() % values);
  return bytes;
}

TEST(Gzip, CompressThenDecompressIsTheIdentity) {
  for (std::uint64_t seed = 1; seed <= 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const Bytes plain = random_bytes(random, random() % 50000, 1 + random() % 256);
    const int level = 1 + static_cast<int>(random() % 12);
    const auto again = gzip_decompress(gzip_compress(plain, level), kPlenty);
    ASSERT_TRUE(again.ok()) << again.error().message;
    ASSERT_EQ(*again, plain);
  }
}

TEST(Gzip, ACompressorGivesTheSameBytesOnEveryCallAndWithoutATime) {
  std::mt19937_64 random(2);
  GzipCompressor compressor(9);
  const Bytes plain = random_bytes(random, 30000, 10);
  const Bytes first = compressor.compress(plain);
  compressor.compress(random_bytes(random, 70000, 200));
  EXPECT_EQ(compressor.compress(plain), first);
  EXPECT_EQ(gzip_compress(plain, 9), first);
  EXPECT_TRUE(is_gzip(first));
  EXPECT_EQ(Bytes(first.begin() + 4, first.begin() + 8), Bytes(4));
}

TEST(Gzip, EveryTruncationAndEveryFlippedBitIsRefusedOrHarmless) {
  std::mt19937_64 random(3);
  const Bytes plain = random_bytes(random, 400, 4);
  Bytes packed = gzip_compress(plain, 6);
  for (std::size_t size = 0; size < packed.size(); ++size) {
    ASSERT_FALSE(gzip_decompress(std::span(packed).first(size), kPlenty).ok()) << size;
  }
  for (std::size_t bit = 0; bit < 8 * packed.size(); ++bit) {
    packed[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
    const auto again = gzip_decompress(packed, kPlenty);
    // Time, flags and system in the header carry no data.
    ASSERT_TRUE(!again.ok() || *again == plain) << bit;
    packed[bit / 8] ^= static_cast<std::uint8_t>(1U << (bit % 8));
  }
}

TEST(Gzip, NothingMayFollowTheMember) {
  const Bytes plain(1000, 7);
  Bytes packed = gzip_compress(plain, 6);
  const Bytes member = packed;
  packed.push_back(0);
  EXPECT_THAT(gzip_decompress(packed, kPlenty).error().message, HasSubstr("1 bytes follow"));
  packed = member;
  packed.insert(packed.end(), member.begin(), member.end());
  EXPECT_THAT(gzip_decompress(packed, kPlenty).error().message, HasSubstr("follow the gzip data"));
}

TEST(Gzip, TheLimitHoldsWhateverTheTrailerSays) {
  const Bytes plain(100000, 7);
  const Bytes packed = gzip_compress(plain, 6);
  EXPECT_TRUE(gzip_decompress(packed, 100000).ok());
  EXPECT_THAT(gzip_decompress(packed, 99999).error().message, HasSubstr("more than 99999 bytes"));
  EXPECT_FALSE(gzip_decompress(packed, 0).ok());
  for (const std::uint8_t byte : {std::uint8_t{0}, std::uint8_t{0xFF}}) {
    Bytes lying = packed;
    std::fill(lying.end() - 4, lying.end(), byte);
    EXPECT_FALSE(gzip_decompress(lying, kPlenty).ok());
    EXPECT_FALSE(gzip_decompress(lying, 50000).ok());
  }
}

TEST(Gzip, WhatIsNoGzipIsToldApart) {
  EXPECT_FALSE(is_gzip({}));
  EXPECT_FALSE(is_gzip(Bytes{0x1F}));
  EXPECT_TRUE(is_gzip(Bytes{0x1F, 0x8B, 8, 0x1F}));
  // The start of a tile of real terrain, uncompressed: the lowest bytes of its centre's x.
  EXPECT_FALSE(is_gzip(Bytes{0x1F, 0x8B, 0xFD, 0x58}));
  EXPECT_FALSE(is_gzip(Bytes{0x1F, 0x8B, 8, 0x20}));
  EXPECT_EQ(gzip_decompress(Bytes(40), kPlenty).error().message, "the data is not gzip");
  EXPECT_TRUE(gzip_decompress(gzip_compress({}, 6), kPlenty)->empty());
}

}  // namespace
}  // namespace qmpipe::gzip_test
