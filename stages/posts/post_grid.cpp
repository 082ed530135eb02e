#include "stages/posts/post_grid.h"

#include <algorithm>
#include <cmath>

#include "formats/tile/quantized_mesh.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

std::vector<std::int32_t> rounded(const std::vector<double>& exact) {
  std::vector<std::int32_t> result;
  result.reserve(exact.size());
  for (const double x : exact) result.push_back(static_cast<std::int32_t>(std::floor(x + 0.5)));
  return result;
}

}  // namespace

PostGrid make_tile_grid(const TilingScheme& scheme, const TileKey& key) {
  const Lattice lattice(scheme, key.zoom);
  const std::int64_t i0 = first_post(key.x);
  const std::int64_t j0 = first_post(key.y);
  const double south_deg = lattice.latitude_deg(j0);
  const double height_deg = lattice.latitude_deg(j0 + kTileIntervals) - south_deg;
  PostGrid grid;
  grid.width_posts = kTilePosts;
  grid.height_posts = kTilePosts;
  for (std::int32_t k = 0; k < kTilePosts; ++k) {
    grid.longitude_deg.push_back(lattice.longitude_deg(i0 + k));
    grid.latitude_deg.push_back(lattice.latitude_deg(j0 + k));
    grid.u_exact.push_back(k * (static_cast<double>(kQuantizedMax) / kTileIntervals));
    grid.v_exact.push_back(scheme.projection() == Projection::kGeodetic
                               ? grid.u_exact.back()
                               : (grid.latitude_deg.back() - south_deg) / height_deg *
                                     kQuantizedMax);
  }
  grid.u = rounded(grid.u_exact);
  grid.v = rounded(grid.v_exact);
  return grid;
}

PostGrid make_plane_grid(std::int32_t width_posts, std::int32_t height_posts, double spacing_x_m,
                         double spacing_y_m) {
  const std::int32_t larger = std::max(width_posts, height_posts);
  QMPIPE_CHECK(std::min(width_posts, height_posts) >= 2 && larger <= kQuantizedMax + 1);
  QMPIPE_CHECK(spacing_x_m > 0 && spacing_y_m > 0);
  const std::int32_t units = kQuantizedMax / (larger - 1);
  PostGrid grid;
  grid.width_posts = width_posts;
  grid.height_posts = height_posts;
  grid.metres_per_u = spacing_x_m / units;
  grid.metres_per_v = spacing_y_m / units;
  for (std::int32_t i = 0; i < width_posts; ++i) grid.u_exact.push_back(i * units);
  for (std::int32_t j = 0; j < height_posts; ++j) grid.v_exact.push_back(j * units);
  grid.u = rounded(grid.u_exact);
  grid.v = rounded(grid.v_exact);
  return grid;
}

}  // namespace qmpipe
