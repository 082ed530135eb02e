#include "formats/pmtiles/id.h"

#include <algorithm>
#include <utility>

#include "formats/pmtiles/pmtiles.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Turns and mirrors a quadrant's curve into its place within the square above it; its own inverse.
void turn_quadrant(std::uint32_t side, bool is_east, bool is_south, ArchivePosition& at) {
  if (is_south) return;
  if (is_east) {
    at.x = side - 1 - at.x;
    at.y = side - 1 - at.y;
  }
  std::swap(at.x, at.y);
}

std::int32_t archive_zoom(std::int32_t zoom, Projection projection) {
  return projection == Projection::kGeodetic ? zoom + 1 : zoom;
}

}  // namespace

std::uint64_t first_archive_id(std::int32_t zoom) {
  QMPIPE_CHECK(zoom >= 0 && zoom <= kDeepestArchiveZoom + 1);
  return ((std::uint64_t{1} << (2 * static_cast<unsigned>(zoom))) - 1) / 3;
}

std::uint64_t archive_id(const ArchivePosition& position) {
  QMPIPE_CHECK(position.zoom >= 0 && position.zoom <= kDeepestArchiveZoom);
  const std::uint32_t columns = 1U << static_cast<unsigned>(position.zoom);
  QMPIPE_CHECK(position.x < columns && position.y < columns);
  ArchivePosition at = position;
  std::uint64_t id = first_archive_id(position.zoom);
  for (std::uint32_t side = columns / 2; side > 0; side /= 2) {
    const bool is_east = at.x >= side;
    const bool is_south = at.y >= side;
    if (is_east) at.x -= side;
    if (is_south) at.y -= side;
    // The curve visits north-west, south-west, south-east, north-east.
    const std::uint64_t quadrant = is_east ? (is_south ? 2 : 3) : (is_south ? 1 : 0);
    id += quadrant * side * side;
    turn_quadrant(side, is_east, is_south, at);
  }
  return id;
}

std::optional<ArchivePosition> archive_position(std::uint64_t id) {
  std::int32_t zoom = 0;
  while (zoom <= kDeepestArchiveZoom && id >= first_archive_id(zoom + 1)) ++zoom;
  if (zoom > kDeepestArchiveZoom) return std::nullopt;
  std::uint64_t rest = id - first_archive_id(zoom);
  ArchivePosition at = {.zoom = zoom, .x = 0, .y = 0};
  for (std::uint32_t side = 1; side < 1U << static_cast<unsigned>(zoom); side *= 2) {
    const std::uint64_t quadrant = rest % 4;
    rest /= 4;
    const bool is_east = quadrant >= 2;
    const bool is_south = quadrant == 1 || quadrant == 2;
    turn_quadrant(side, is_east, is_south, at);
    if (is_east) at.x += side;
    if (is_south) at.y += side;
  }
  return at;
}

std::uint64_t pmtiles_id(const TileKey& key, Projection projection) {
  const TilingScheme scheme(projection);
  QMPIPE_CHECK(scheme.contains(key));
  return archive_id({.zoom = archive_zoom(key.zoom, projection),
                     .x = static_cast<std::uint32_t>(key.x),
                     .y = static_cast<std::uint32_t>(scheme.rows(key.zoom) - 1 - key.y)});
}

std::optional<TileKey> key_of_archive_id(std::uint64_t id, Projection projection) {
  const std::optional<ArchivePosition> at = archive_position(id);
  if (!at) return std::nullopt;
  const std::int32_t zoom = at->zoom - archive_zoom(0, projection);
  if (zoom < 0 || zoom > kMaxZoom) return std::nullopt;
  const TilingScheme scheme(projection);
  const TileKey key = {.zoom = zoom,
                       .x = static_cast<std::int32_t>(at->x),
                       .y = scheme.rows(zoom) - 1 - static_cast<std::int32_t>(at->y)};
  if (!scheme.contains(key)) return std::nullopt;
  return key;
}

void sort_for_pmtiles(std::vector<TileKey>& keys, Projection projection) {
  std::vector<std::pair<std::uint64_t, TileKey>> numbered;
  numbered.reserve(keys.size());
  for (const TileKey& key : keys) numbered.emplace_back(pmtiles_id(key, projection), key);
  std::sort(numbered.begin(), numbered.end());
  for (std::size_t k = 0; k < keys.size(); ++k) keys[k] = numbered[k].second;
}

}  // namespace qmpipe
