// The order in which the survey samples the blocks of the lattice, such that a small cache of source
// blocks is enough to decode each of them about once.
//
// All threads work on one front: it goes from north to south (as files store their rows) through
// strips of the lattice as wide as the cache allows, most often all of it at once. A source block is
// then needed only while the front passes; where strips meet, blocks are decoded once for each strip.
// Guarantees: pure functions. What they say of bytes is an upper estimate for sources whose rows lie
// along the lattice's; of rasters that stand askew the front touches more.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/sources/raster_source.h"
#include "scheduler/lattice.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

// What the front touches while it passes a strip of so many blocks of posts: the most of any row.
// `threads`: how far the front is from being a line.
std::int64_t front_bytes(const Lattice& lattice, const std::vector<RasterInfo>& sources,
                         std::int32_t threads, std::int32_t strip_blocks);

// The widest strip whose front fits the cache, a power of two; where none does, the widest of those
// with the smallest front.
std::int32_t widest_strip(const Lattice& lattice, const std::vector<RasterInfo>& sources,
                          std::int32_t threads, std::int64_t cache_bytes);

// Strip by strip from the west, in each row by row from the north.
// REQUIRES: blocks of one zoom, strip_blocks >= 1.
void sort_for_sampling(std::vector<TileKey>& blocks, std::int32_t strip_blocks);

}  // namespace qmpipe
