// The heights that a tile set has, without reading all of it.
#pragma once

#include <optional>

#include "formats/tile/tile_set.h"
#include "stages/posts/height_step.h"

namespace qmpipe::verify {

// From the lowest to the highest height of the set's deepest tiles, as their headers say, of some
// hundred tiles that are read: those of a coarse zoom, and from there to the deepest what lies under the
// highest and the lowest of each zoom. So a summit is found in a set of any size when the tiles above it
// stand out; the range may be narrower than the truth, never wider. None where no tile can be read.
std::optional<HeightSpan> glance_at_heights(const TileSet& tile_set);

}  // namespace qmpipe::verify
