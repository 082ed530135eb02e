// Which blocks of the lattice sources touch, zoom by zoom. Pure functions.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/lattice_store.h"
#include "formats/raster_source.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

// Blocks are named like tiles; row 2^zoom holds the last row of posts.
using BlockKey = TileKey;

// Sorted, none twice: every block that may have a valid post is among them.
std::vector<BlockKey> covered_blocks(const TilingScheme& scheme, std::int32_t zoom,
                                     const std::vector<RasterInfo>& sources);

// How many blocks of one zoom these sources touch at most.
std::int64_t expected_blocks(const TilingScheme& scheme, std::int32_t zoom,
                             const std::vector<RasterInfo>& sources);

// The blocks of the next coarser zoom that may have a valid post where the given ones do: a coarse
// post looks at finer posts one step to each side, so the last row and column of an odd block count
// in the next block too.
// REQUIRES: blocks of one zoom above 0.
std::vector<BlockKey> coarser_blocks(const TilingScheme& scheme,
                                     const std::vector<BlockKey>& blocks);

}  // namespace qmpipe
