// Voids of a single DEM: filled before its simplification, left out of the TIN after it.
//
// const use is safe from several threads. Pure: same input, same bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/surface/tin.h"

namespace qmpipe {

// Gives every void a height that runs smoothly between the valid posts around it, so that no vertex
// is spent on the void's outline: means over squares of 2, 4, 8... posts, the finest with a valid one,
// interpolated (pull-push, Gortler et al. 1996, "The Lumigraph"). Filled heights lie within the range
// of the valid ones, which stay as they are. Takes 2 bytes a post while it works.
// REQUIRES: width_posts x height_posts heights, row by row; a void is one whose flag is 0; at least one
// is valid.
void fill_voids(std::int32_t width_posts, std::int32_t height_posts,
                std::span<const std::uint8_t> valid, std::span<float> heights_m);

// The TIN without the triangles of whose posts more than half are void (where a triangle has no post
// inside: whose middle is nearest to a void), and without the vertices that no triangle has then.
// The rest keeps its order. REQUIRES: grid.post_count() flags.
Tin without_void_triangles(const PostGrid& grid, Tin tin, std::span<const std::uint8_t> valid);

}  // namespace qmpipe
