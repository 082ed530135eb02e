#include "scheduler/tiling_scheme.h"

#include "scheduler/check.h"
#include "scheduler/lattice.h"

namespace qmpipe {

const char* name_of(Side side) {
  switch (side) {
    case Side::kWest:
      return "west";
    case Side::kSouth:
      return "south";
    case Side::kEast:
      return "east";
    case Side::kNorth:
      return "north";
  }
  return "?";
}

bool TilingScheme::contains(const TileKey& key) const {
  return key.zoom >= 0 && key.zoom <= kMaxZoom && key.x >= 0 && key.x < columns(key.zoom) &&
         key.y >= 0 && key.y < rows(key.zoom);
}

RectangleDeg TilingScheme::rectangle_deg(const TileKey& key) const {
  QMPIPE_CHECK(contains(key));
  // The lattice is the one place that knows coordinates, so that a tile's corner and the post on
  // it are the same double.
  const Lattice lattice(*this, key.zoom);
  const std::int64_t i0 = first_post(key.x);
  const std::int64_t j0 = first_post(key.y);
  return {.west_deg = lattice.longitude_deg(i0),
          .south_deg = lattice.latitude_deg(j0),
          .east_deg = lattice.longitude_deg(i0 + kTileIntervals),
          .north_deg = lattice.latitude_deg(j0 + kTileIntervals)};
}

std::vector<TileKey> TilingScheme::roots() const {
  std::vector<TileKey> keys;
  for (std::int32_t x = 0; x < columns(0); ++x) keys.push_back({.zoom = 0, .x = x, .y = 0});
  return keys;
}

std::optional<TileKey> TilingScheme::neighbour(const TileKey& key, Side side) const {
  QMPIPE_CHECK(contains(key));
  TileKey other = key;
  const std::int32_t n = columns(key.zoom);
  switch (side) {
    case Side::kWest:
      other.x = key.x == 0 ? n - 1 : key.x - 1;
      break;
    case Side::kEast:
      other.x = key.x == n - 1 ? 0 : key.x + 1;
      break;
    case Side::kSouth:
      other.y = key.y - 1;
      break;
    case Side::kNorth:
      other.y = key.y + 1;
      break;
  }
  if (other.y < 0 || other.y >= rows(key.zoom)) return std::nullopt;
  return other;
}

}  // namespace qmpipe
