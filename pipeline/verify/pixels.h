// Do the heights of the sources have tiles? Asked of pixels, whose places on the globe are looked up
// outwards, where a build looks for the pixels of its posts: a part of a raster that the build's way
// does not reach shows here, and would not where the same way is gone again.
#pragma once

#include <vector>

#include "formats/sources/raster_source.h"
#include "pipeline/common/finding.h"
#include "pipeline/recipe/recipe.h"

namespace qmpipe::verify {

// Of some thousand pixels in all that stand among valid ones, the tiles of the deepest zoom that the
// set lacks, each once; none of those in `expected`, which are looked for otherwise.
// `heights`: what the sources were opened with.
// REQUIRES: keys and expected are sorted. Throws IoError when a source cannot be read.
std::vector<Finding> check_pixels(const std::vector<RasterInfo>& sources,
                                  const HeightOptions& heights, const Recipe& recipe,
                                  const std::vector<TileKey>& keys,
                                  const std::vector<TileKey>& expected);

}  // namespace qmpipe::verify
