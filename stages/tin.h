// The surface of one tile between simplification and quantization: a TIN over lattice posts.
//
// Frames: post (i, j) of a tile has 0 <= i, j <= 256, i to the east, j to the north. (u, v) is the
// quantized frame of the file, 0..32767. TileGrid maps one to the other; the simplifiers
// triangulate in (u, v), because that is the plane in which a client interpolates heights: in the
// mercator scheme v is linear in latitude, not in j (FORMATS 2.7).
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "scheduler/border.h"
#include "scheduler/lattice.h"

namespace qmpipe {

// Where the columns and rows of a tile's posts lie in the quantized frame.
struct TileGrid {
  // Rounded, as a vertex is stored.
  std::array<std::int32_t, kTilePosts> u{};
  std::array<std::int32_t, kTilePosts> v{};
  // Exact, as the post lies on the globe; |exact - rounded| <= 0.5.
  std::array<double, kTilePosts> u_exact{};
  std::array<double, kTilePosts> v_exact{};
  std::array<double, kTilePosts> longitude_deg{};
  std::array<double, kTilePosts> latitude_deg{};
};

TileGrid make_tile_grid(const TilingScheme& scheme, const TileKey& key);

// Index of post (i, j) in a 257 x 257 array, row by row from the south. Ties between posts are
// broken by it.
constexpr std::int32_t tile_post_index(std::int32_t i, std::int32_t j) {
  return j * kTilePosts + i;
}
inline constexpr std::size_t kTilePostCount =
    static_cast<std::size_t>(kTilePosts) * static_cast<std::size_t>(kTilePosts);

struct Tin {
  // Vertices: tile_post_index of each.
  std::vector<std::int32_t> posts;
  // Three vertices for each triangle, counter-clockwise in (u, v).
  std::vector<std::uint32_t> indices;

  std::size_t triangle_count() const { return indices.size() / 3; }
};

// The vertices on one side of the tile.
BorderMask border_of(const Tin& tin, Side side);

}  // namespace qmpipe
