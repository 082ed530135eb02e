// Which blocks of the lattice sources touch, zoom by zoom. Pure functions.
#pragma once

#include <compare>
#include <cstdint>
#include <vector>

#include "formats/sources/raster_source.h"
#include "scheduler/block_key.h"

namespace qmpipe {

// Columns first_x .. first_x + width - 1 (they wrap) and rows first_y .. first_y + height - 1.
struct BlockSpan {
  std::int32_t first_x = 0;
  std::int32_t first_y = 0;
  std::int32_t width = 0;
  std::int32_t height = 0;
  friend auto operator<=>(const BlockSpan&, const BlockSpan&) = default;
};

// Every block in which the source may have a valid post.
BlockSpan covered_span(const Lattice& lattice, const RasterInfo& source);

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
