// Where a tile lies on the globe, and which tiles are its neighbours.
//
// Two schemes (FORMATS: quantized-mesh layer.json, `projection`):
//   geodetic  EPSG:4326, 2 x 1 root tiles, every tile 180/2^zoom degrees wide and high
//   mercator  EPSG:3857, 1 x 1 root tile, tiles square on the Web Mercator plane
// Columns wrap at the antimeridian in both, so the last column's east neighbour is column 0.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/tile_key.h"

namespace qmpipe {

enum class Projection { kGeodetic, kMercator };

// The sides of a tile in the order of the specification's index lists.
enum class Side : std::uint8_t { kWest = 0, kSouth = 1, kEast = 2, kNorth = 3 };
inline constexpr std::array<Side, 4> kSides = {Side::kWest, Side::kSouth, Side::kEast,
                                               Side::kNorth};
constexpr std::size_t index_of(Side side) { return static_cast<std::size_t>(side); }
constexpr Side opposite(Side side) { return static_cast<Side>((index_of(side) + 2) % 4); }
const char* name_of(Side side);

// Degrees; west < east and south < north always (a tile never crosses the antimeridian).
struct RectangleDeg {
  double west_deg = 0;
  double south_deg = 0;
  double east_deg = 0;
  double north_deg = 0;
  friend bool operator==(const RectangleDeg&, const RectangleDeg&) = default;
};

class TilingScheme {
 public:
  explicit TilingScheme(Projection projection) : projection_(projection) {}

  Projection projection() const { return projection_; }
  // Number of tiles from west to east, and from south to north.
  std::int32_t columns(std::int32_t zoom) const {
    return (projection_ == Projection::kGeodetic ? 2 : 1) << zoom;
  }
  std::int32_t rows(std::int32_t zoom) const { return 1 << zoom; }
  bool contains(const TileKey& key) const;
  RectangleDeg rectangle_deg(const TileKey& key) const;
  std::vector<TileKey> roots() const;

  // The tile across a side; none beyond the first and last row. In the mercator scheme the root is
  // its own neighbour to the west and east.
  std::optional<TileKey> neighbour(const TileKey& key, Side side) const;

  friend bool operator==(const TilingScheme&, const TilingScheme&) = default;

 private:
  Projection projection_;
};

// 0 (even x, even y), 1 (odd, even), 2 (even, odd), 3 (odd, odd): tiles of one colour share no side.
constexpr int colour_of(const TileKey& key) { return (key.x & 1) + 2 * (key.y & 1); }

}  // namespace qmpipe
