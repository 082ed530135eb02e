// The posts that a TIN is made from, as a grid in the plane of the quantized frame.
//
// Frames: post (i, j) counts i to the east and j to the north from the south-west corner. (u, v) is
// the quantized frame, integers up to 32767; simplifiers triangulate in it, because that is the
// plane in which a client interpolates heights: in the mercator scheme v is linear in latitude,
// not in j (FORMATS 2.7). Arrays over posts go row by row from the south.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "scheduler/lattice.h"

namespace qmpipe {

struct PostGrid {
  std::int32_t width_posts = 0;
  std::int32_t height_posts = 0;
  // Where columns and rows lie in the quantized frame, from 0: rounded, as a vertex is stored, and
  // exact, as the post lies on the ground; |exact - rounded| <= 0.5. Columns are evenly spaced.
  std::vector<std::int32_t> u;
  std::vector<std::int32_t> v;
  std::vector<double> u_exact;
  std::vector<double> v_exact;
  // On the globe; both are empty on a plane.
  std::vector<double> longitude_deg;
  std::vector<double> latitude_deg;
  // On a plane: metres of one unit of u and of v; 0 on the globe.
  double metres_per_u = 0;
  double metres_per_v = 0;

  bool on_globe() const { return !longitude_deg.empty(); }
  std::size_t post_count() const {
    return static_cast<std::size_t>(width_posts) * static_cast<std::size_t>(height_posts);
  }
  // Index of a post; ties between posts are broken by it.
  std::int32_t index(std::int32_t i, std::int32_t j) const { return j * width_posts + i; }
  std::int32_t column(std::int32_t post) const { return post % width_posts; }
  std::int32_t row(std::int32_t post) const { return post / width_posts; }
  std::int32_t u_max() const { return u.back(); }
  std::int32_t v_max() const { return v.back(); }
  double columns_per_u() const { return (width_posts - 1) / u_exact.back(); }
};

// The 257 x 257 posts of a tile; u and v reach from 0 to 32767.
PostGrid make_tile_grid(const TilingScheme& scheme, const TileKey& key);

// Posts of a plane, `spacing` metres apart; u and v have the same number of units between two posts.
// REQUIRES: 2 <= width_posts, height_posts <= 32768; spacings > 0.
PostGrid make_plane_grid(std::int32_t width_posts, std::int32_t height_posts, double spacing_x_m,
                         double spacing_y_m);

// Index of post (i, j) in a tile's 257 x 257 array.
constexpr std::int32_t tile_post_index(std::int32_t i, std::int32_t j) {
  return j * kTilePosts + i;
}
inline constexpr std::size_t kTilePostCount =
    static_cast<std::size_t>(kTilePosts) * static_cast<std::size_t>(kTilePosts);

}  // namespace qmpipe
