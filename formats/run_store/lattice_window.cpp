#include "formats/run_store/lattice_window.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// A rectangle of posts inside one block.
struct BlockRun {
  std::int64_t i = 0;
  std::int64_t j_first = 0;
  std::int64_t j_stop = 0;
  std::int32_t width_posts = 0;
};

std::int32_t posts_left_in_block(std::int64_t i) {
  return kBlockPosts - static_cast<std::int32_t>(i % kBlockPosts);
}

void copy_run(const std::vector<float>& block, const BlockRun& run, const PostWindow& window,
              std::int32_t column, std::span<float> out) {
  for (std::int64_t j = run.j_first; j < run.j_stop; ++j) {
    const auto from = block.begin() + j % kBlockPosts * kBlockPosts + run.i % kBlockPosts;
    const auto to = out.begin() + (j - window.j0) * window.width_posts;
    std::copy(from, from + run.width_posts, to + column);
  }
}

}  // namespace

bool is_block_of(const TilingScheme& scheme, std::int32_t max_zoom, const BlockKey& block) {
  return block.zoom >= 0 && block.zoom <= max_zoom && block.x >= 0 &&
         block.x < scheme.columns(block.zoom) && block.y >= 0 && block.y <= scheme.rows(block.zoom);
}

bool is_all_void(std::span<const float> heights_m) {
  return std::all_of(heights_m.begin(), heights_m.end(), [](float h) { return std::isnan(h); });
}

void read_window(const Lattice& lattice, const PostWindow& window,
                 const std::function<BlockHeights(const BlockKey&)>& block_at,
                 std::span<float> out) {
  QMPIPE_CHECK(out.size() == window.size());
  std::fill(out.begin(), out.end(), std::numeric_limits<float>::quiet_NaN());
  const std::int64_t j_end = std::min(window.j0 + window.height_posts, lattice.rows());
  for (std::int64_t j = std::max<std::int64_t>(window.j0, 0); j < j_end;) {
    const std::int64_t j_stop = std::min(j_end, (j / kBlockPosts + 1) * kBlockPosts);
    for (std::int32_t k = 0; k < window.width_posts;) {
      const std::int64_t i = lattice.wrap_column(window.i0 + k);
      const std::int32_t width = std::min(window.width_posts - k, posts_left_in_block(i));
      const BlockHeights block =
          block_at({.zoom = lattice.zoom(), .x = block_of_post(i), .y = block_of_post(j)});
      if (block != nullptr) {
        copy_run(*block, {.i = i, .j_first = j, .j_stop = j_stop, .width_posts = width}, window, k,
                 out);
      }
      k += width;
    }
    j = j_stop;
  }
}

}  // namespace qmpipe
