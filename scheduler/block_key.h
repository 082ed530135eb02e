// The name of one block of a zoom's posts: 256 x 256 of them, which are made, kept and moved together.
//
// Blocks are numbered like tiles, in which a tile has the posts of one block and, on its far sides, the first ones
// of the next: block (x, y) has posts 256*x .. 256*x + 255 and 256*y .. 256*y + 255. Row 2^zoom of blocks holds the
// lattice's last row of posts, in its row 0.
#pragma once

#include <cstddef>
#include <cstdint>

#include "scheduler/lattice.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

using BlockKey = TileKey;

inline constexpr std::int32_t kBlockPosts = 256;

inline constexpr std::size_t kBlockSize =
    static_cast<std::size_t>(kBlockPosts) * static_cast<std::size_t>(kBlockPosts);

// The column or row of blocks that a column or row of posts lies in. REQUIRES: post >= 0.
constexpr std::int32_t block_of_post(std::int64_t post) {
  return static_cast<std::int32_t>(post / kBlockPosts);
}
// The first post of a column or row of blocks.
constexpr std::int64_t first_post_of_block(std::int32_t block) {
  return std::int64_t{block} * kBlockPosts;
}

inline PostWindow posts_of(const BlockKey& block) {
  return {.i0 = first_post_of_block(block.x),
          .j0 = first_post_of_block(block.y),
          .width_posts = kBlockPosts,
          .height_posts = kBlockPosts};
}

}  // namespace qmpipe
