// The dense triangulation that methods start from which take vertices away: every post, but on a
// fixed side only the given ones (D of Campos et al. 2020, section 4).
#pragma once

#include <span>

#include "stages/surface/tin.h"

namespace qmpipe {

// Guarantees: vertices in the order of their posts; all triangles counter-clockwise. A cell of four
// posts is divided between the two that are nearer in height (between south-west and north-east
// when they are equal), a strip along a side by its shorter diagonals.
// REQUIRES: grid.post_count() heights; fixed borders only for a tile's 257 x 257 posts.
Tin base_tin(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
             const HeightSteps& height_steps);

}  // namespace qmpipe
