// Puts a window of posts together from a store's blocks; shared by all lattice stores.
#pragma once

#include <cstddef>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "formats/run_store/lattice_store.h"

namespace qmpipe {

// 256 x 256 heights; null for a block that is all void.
using BlockHeights = std::shared_ptr<const std::vector<float>>;

// Whether a store of this scheme and depth has the block: rows reach one beyond the tiles'.
bool is_block_of(const TilingScheme& scheme, std::int32_t max_zoom, const BlockKey& block);

bool is_all_void(std::span<const float> heights_m);

// LatticeStore::read() in terms of whole blocks. `block_at` is asked once for every run of posts
// inside one block, row of blocks by row of blocks from the south; what it throws comes out.
void read_window(const Lattice& lattice, const PostWindow& window,
                 const std::function<BlockHeights(const BlockKey&)>& block_at,
                 std::span<float> out);

}  // namespace qmpipe
