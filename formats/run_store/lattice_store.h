// The heights of every zoom's posts, written once by the survey and read by the mesh pass.
//
// Posts are kept in blocks of 256 x 256: block (bx, by) of a zoom holds posts 256*bx .. 256*bx+255,
// 256*by .. 256*by+255, row by row from the south, in metres as float32, voids as NaN. The last row
// of a lattice (j = rows - 1) lies in block row 2^zoom, in that block's row 0. A block that was
// never written is all void and takes no room.
// put_block() and read() are safe from several threads, as long as no block is read while it is
// written.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "scheduler/lattice.h"

namespace qmpipe {

inline constexpr std::int32_t kBlockPosts = 256;

// The column or row of blocks that a column or row of posts lies in. REQUIRES: post >= 0.
constexpr std::int32_t block_of_post(std::int64_t post) {
  return static_cast<std::int32_t>(post / kBlockPosts);
}
// The first post of a column or row of blocks.
constexpr std::int64_t first_post_of_block(std::int32_t block) {
  return std::int64_t{block} * kBlockPosts;
}

class LatticeStore {
 public:
  virtual ~LatticeStore() = default;
  // REQUIRES: heights_m.size() == 256 * 256; bx, by inside the zoom.
  virtual void put_block(std::int32_t zoom, std::int32_t bx, std::int32_t by,
                         std::span<const float> heights_m) = 0;
  virtual bool has_block(std::int32_t zoom, std::int32_t bx, std::int32_t by) const = 0;
  // Fills `out` row by row from the south. Columns wrap at the antimeridian; rows outside the
  // lattice read as void. REQUIRES: out.size() == window.size().
  virtual void read(const Lattice& lattice, const PostWindow& window,
                    std::span<float> out) const = 0;
  // What was put before the call is safe on disk after it, where the store is on disk.
  virtual void seal() = 0;
  virtual std::int64_t memory_bytes() const = 0;
};

// Keeps everything in memory; blocks without a valid post take no room.
std::unique_ptr<LatticeStore> make_memory_lattice_store(TilingScheme scheme, std::int32_t max_zoom);

}  // namespace qmpipe
