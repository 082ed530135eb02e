// The name of one tile of a pyramid.
//
// zoom 0 is the coarsest. x counts from west to east, y from south to north (TMS), both from 0.
// Keys order by zoom, then row, then column, which is the order in which reports list them.
#pragma once

#include <compare>
#include <cstdint>
#include <functional>
#include <string>

namespace qmpipe {

struct TileKey {
  std::int32_t zoom = 0;
  std::int32_t x = 0;
  std::int32_t y = 0;

  friend constexpr bool operator==(const TileKey&, const TileKey&) = default;
  friend constexpr std::strong_ordering operator<=>(const TileKey& a, const TileKey& b) {
    if (const auto order = a.zoom <=> b.zoom; order != 0) return order;
    if (const auto order = a.y <=> b.y; order != 0) return order;
    return a.x <=> b.x;
  }
};

// The deepest zoom: posts 5 mm apart. Tiles are counted in 32 bits, the lattice's posts in 64.
inline constexpr std::int32_t kMaxZoom = 24;

// REQUIRES: key.zoom > 0.
constexpr TileKey parent_of(const TileKey& key) {
  return {.zoom = key.zoom - 1, .x = key.x / 2, .y = key.y / 2};
}

// "zoom/x/y", as in a tile's path.
inline std::string to_string(const TileKey& key) {
  return std::to_string(key.zoom) + "/" + std::to_string(key.x) + "/" + std::to_string(key.y);
}

// One 64-bit word that is different for every key up to kMaxZoom:
//   bits 58..63 zoom | bits 29..57 y | bits 0..28 x
constexpr std::uint64_t packed(const TileKey& key) {
  return (static_cast<std::uint64_t>(key.zoom) << 58U) |
         (static_cast<std::uint64_t>(key.y) << 29U) | static_cast<std::uint64_t>(key.x);
}

struct TileKeyHash {
  std::size_t operator()(const TileKey& key) const noexcept {
    return static_cast<std::size_t>(packed(key) * 0x9E3779B97F4A7C15ULL >> 7U);
  }
};

}  // namespace qmpipe
