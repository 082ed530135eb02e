#include "stages/tin.h"

#include <cmath>

#include "formats/quantized_mesh.h"

namespace qmpipe {

TileGrid make_tile_grid(const TilingScheme& scheme, const TileKey& key) {
  const Lattice lattice(scheme, key.zoom);
  const std::int32_t i0 = key.x * kTileIntervals;
  const std::int32_t j0 = key.y * kTileIntervals;
  const double south_deg = lattice.latitude_deg(j0);
  const double height_deg = lattice.latitude_deg(j0 + kTileIntervals) - south_deg;
  TileGrid grid;
  for (std::int32_t k = 0; k < kTilePosts; ++k) {
    const auto at = static_cast<std::size_t>(k);
    grid.longitude_deg[at] = lattice.longitude_deg(i0 + k);
    grid.latitude_deg[at] = lattice.latitude_deg(j0 + k);
    grid.u_exact[at] = k * (static_cast<double>(kQuantizedMax) / kTileIntervals);
    grid.v_exact[at] = scheme.projection() == Projection::kGeodetic
                           ? grid.u_exact[at]
                           : (grid.latitude_deg[at] - south_deg) / height_deg * kQuantizedMax;
    grid.u[at] = static_cast<std::int32_t>(std::floor(grid.u_exact[at] + 0.5));
    grid.v[at] = static_cast<std::int32_t>(std::floor(grid.v_exact[at] + 0.5));
  }
  return grid;
}

BorderMask border_of(const Tin& tin, Side side) {
  BorderMask mask;
  for (const std::int32_t post : tin.posts) {
    const std::int32_t i = post % kTilePosts;
    const std::int32_t j = post / kTilePosts;
    const std::int32_t k = (side == Side::kWest || side == Side::kEast) ? j : i;
    const Post on_side = side_post(side, k);
    if (on_side == Post{.i = i, .j = j}) mask.set(k);
  }
  return mask;
}

}  // namespace qmpipe
