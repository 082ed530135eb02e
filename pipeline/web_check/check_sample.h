// Which tiles `check` asks for: those where sets break first, and some at random (with a fixed
// seed, so that the same set is asked for the same tiles).
#pragma once

#include <cstddef>
#include <vector>

#include "formats/tile/layer_json.h"
#include "scheduler/tile_key.h"

namespace qmpipe::web_check {

// The tiles in the middle and at four corners of a zoom's ranges, without repetitions.
// REQUIRES: sound ranges.
std::vector<TileKey> telling_tiles(const std::vector<TileRange>& ranges, std::int32_t zoom);

// Sorted, at most `limit`, without repetitions: the roots, then of every zoom the telling tiles
// (the middle of each zoom before the corners of any), then random ones.
// REQUIRES: sound ranges, by zoom; limit >= 1.
std::vector<TileKey> sample_tiles(const std::vector<std::vector<TileRange>>& available,
                                  const std::vector<TileKey>& roots, std::size_t limit);

}  // namespace qmpipe::web_check
