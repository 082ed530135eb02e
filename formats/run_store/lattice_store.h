// The heights of every zoom's posts, written once by the survey and read by the mesh pass.
//
// Posts are kept in blocks (scheduler/block_key.h), row by row from the south, in metres as float32, voids as NaN.
// A block that was never written is all void and takes no room.
// put_block() and read() are safe from several threads, as long as no block is read while it is
// written.
#pragma once

#include <cstdint>
#include <memory>
#include <span>

#include "scheduler/block_key.h"
#include "scheduler/lattice.h"

namespace qmpipe {

// What the heights of one block take, uncompressed.
inline constexpr auto kBlockBytes = static_cast<std::int64_t>(kBlockSize * sizeof(float));

class LatticeStore {
 public:
  virtual ~LatticeStore() = default;
  // REQUIRES: heights_m.size() == kBlockSize; the block is one of its zoom's.
  virtual void put_block(const BlockKey& block, std::span<const float> heights_m) = 0;
  virtual bool has_block(const BlockKey& block) const = 0;
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
