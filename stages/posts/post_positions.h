// Where posts lie on a raster's grid.
//
// Guarantees: a post's position is a pure function of the post and the raster, whatever block it is
// asked in. Rasters in degrees of WGS84: exact. All others: the exact transformation at anchor
// posts fixed to the lattice, bilinear between them; every cell of anchors is checked at the
// middles of its four sides and split (32, 16 ... 1 posts) until the sum of the errors there is
// below 0.01 pixel.
#pragma once

#include <span>

#include "formats/raster/grid.h"
#include "scheduler/lattice.h"

namespace qmpipe {

inline constexpr std::int32_t kAnchorPosts = 32;
inline constexpr double kPositionTolerancePixels = 0.01;

// Positions of the block's posts, row by row from the south; NaN for posts that certainly do not
// lie on the raster (others may lie outside it too). REQUIRES: 0 <= i0, i0 + width_posts <=
// columns; rows inside the lattice; out.size() == block.size().
void locate_posts(const RasterGrid& grid, const Lattice& lattice, const PostWindow& block,
                  std::span<PixelPoint> out);

// True when the closed rectangle of the posts i0..i1, j0..j1 touches the bounds, widened by two
// pixels and a ten-thousandth (they were measured at points).
struct PostRange {
  std::int64_t i0 = 0;
  std::int64_t j0 = 0;
  std::int64_t i1 = 0;
  std::int64_t j1 = 0;
};
bool touches_bounds(const GridInfo& info, const Lattice& lattice, const PostRange& range);

}  // namespace qmpipe
