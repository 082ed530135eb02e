#include "formats/run_store/border_chunk.h"

#include <fmt/format.h>

#include <bit>

#include "formats/bytes/little_endian.h"
#include "formats/bytes/zstd.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kSideAt = 12;
constexpr std::size_t kMaskAt = 13;
static_assert(kMaskAt + kMaskBytes == kBorderBytes);
static_assert(kMaskBytes * 8 >= kTileIntervals + 1 && (kMaskBytes - 1) * 8 == kTileIntervals);

void store_record(std::uint8_t* to, const Border& border) {
  store_little_endian(to, border.key.owner.zoom);
  store_little_endian(to + 4, border.key.owner.x);
  store_little_endian(to + 8, border.key.owner.y);
  to[kSideAt] = static_cast<std::uint8_t>(border.key.side);
  for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
    if (border.mask.test(k)) {
      to[kMaskAt + static_cast<std::size_t>(k / 8)] |= static_cast<std::uint8_t>(1U << (k % 8));
    }
  }
}

// REQUIRES: the side and the mask exist.
Border load_record(const std::uint8_t* from) {
  Border border;
  border.key = {.owner = {.zoom = load_little_endian<std::int32_t>(from),
                          .x = load_little_endian<std::int32_t>(from + 4),
                          .y = load_little_endian<std::int32_t>(from + 8)},
                .side = static_cast<Side>(from[kSideAt])};
  for (std::size_t byte = 0; byte < kMaskBytes; ++byte) {
    for (unsigned bits = from[kMaskAt + byte]; bits != 0; bits &= bits - 1) {
      border.mask.set(static_cast<std::int32_t>(8 * byte) + std::countr_zero(bits));
    }
  }
  return border;
}

bool is_record(const std::uint8_t* from) {
  return from[kSideAt] < kSides.size() && from[kBorderBytes - 1] <= 1;
}

}  // namespace

std::string to_string(const BorderKey& key) {
  return fmt::format("{} {}", to_string(key.owner), name_of(key.side));
}

std::size_t largest_border_chunk_bytes() {
  return largest_zstd_bytes(kMaxChunkBorders * kBorderBytes);
}

std::vector<std::uint8_t> pack_borders(std::span<const Border> borders, std::size_t records,
                                       int level) {
  QMPIPE_CHECK(!borders.empty() && borders.size() <= records && records <= kMaxChunkBorders);
  std::vector<std::uint8_t> planes(records * kBorderBytes);
  for (std::size_t n = 0; n < borders.size(); ++n) {
    std::array<std::uint8_t, kBorderBytes> record{};
    store_record(record.data(), borders[n]);
    for (std::size_t k = 0; k < kBorderBytes; ++k) planes[k * records + n] = record[k];
  }
  return zstd_pack(planes, level);
}

Result<std::vector<Border>> unpack_borders(std::span<const std::uint8_t> chunk, std::size_t count,
                                           std::size_t records) {
  QMPIPE_CHECK(count >= 1 && count <= records && records <= kMaxChunkBorders);
  const auto planes = zstd_unpack(chunk, records * kBorderBytes);
  if (!planes) return planes.error();
  std::vector<Border> borders;
  borders.reserve(count);
  for (std::size_t n = 0; n < count; ++n) {
    std::array<std::uint8_t, kBorderBytes> record{};
    for (std::size_t k = 0; k < kBorderBytes; ++k) record[k] = (*planes)[k * records + n];
    if (!is_record(record.data())) return Error{fmt::format("its record {} is no border", n)};
    const Border border = load_record(record.data());
    if (n > 0 && borders.back().key >= border.key) {
      return Error{fmt::format("its record {} is out of order", n)};
    }
    borders.push_back(border);
  }
  return borders;
}

}  // namespace qmpipe
