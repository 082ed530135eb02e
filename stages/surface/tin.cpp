#include "stages/surface/tin.h"

#include <algorithm>

namespace qmpipe {

TinVertex vertex_at_post(const PostGrid& grid, std::int32_t post, float height_m,
                         const HeightSteps& height_steps) {
  const std::int32_t i = grid.column(post);
  const std::int32_t j = grid.row(post);
  const bool is_on_side =
      i == 0 || j == 0 || i == grid.width_posts - 1 || j == grid.height_posts - 1;
  return {.u = grid.u[static_cast<std::size_t>(i)],
          .v = grid.v[static_cast<std::size_t>(j)],
          .post = post,
          .height_m = snapped_height(static_cast<double>(height_m),
                                     is_on_side ? height_steps.side_m : height_steps.inner_m)};
}

std::int32_t post_at(const PostGrid& grid, std::int32_t u, std::int32_t v) {
  const auto column = std::lower_bound(grid.u.begin(), grid.u.end(), u);
  const auto row = std::lower_bound(grid.v.begin(), grid.v.end(), v);
  if (column == grid.u.end() || *column != u) return kNoPost;
  if (row == grid.v.end() || *row != v) return kNoPost;
  return grid.index(static_cast<std::int32_t>(column - grid.u.begin()),
                    static_cast<std::int32_t>(row - grid.v.begin()));
}

BorderMask border_of(const Tin& tin, Side side) {
  BorderMask mask;
  for (const TinVertex& vertex : tin.vertices) {
    if (vertex.post == kNoPost) continue;
    const std::int32_t i = vertex.post % kTilePosts;
    const std::int32_t j = vertex.post / kTilePosts;
    const std::int32_t k = (side == Side::kWest || side == Side::kEast) ? j : i;
    const Post on_side = side_post(side, k);
    if (on_side == Post{.i = i, .j = j}) mask.set(k);
  }
  return mask;
}

}  // namespace qmpipe
