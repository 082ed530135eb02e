#include "stages/posts/reduce.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "formats/heights/void_height.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// The 3 x 3 posts around a post of the finer zoom, from the south-west.
struct Neighbourhood {
  const float* centre;
  std::int32_t row_stride;
  float at(std::int32_t di, std::int32_t dj) const { return centre[dj * row_stride + di]; }
};

float mean_of(const Neighbourhood& posts) {
  constexpr double kWeight[3] = {1, 2, 1};
  double sum = 0;
  double weight = 0;
  for (std::int32_t dj = -1; dj <= 1; ++dj) {
    for (std::int32_t di = -1; di <= 1; ++di) {
      const auto height_m = static_cast<double>(posts.at(di, dj));
      if (std::isnan(height_m)) continue;
      const double w = kWeight[di + 1] * kWeight[dj + 1];
      sum += w * height_m;
      weight += w;
    }
  }
  return weight > 0 ? static_cast<float>(sum / weight) : kVoidHeight;
}

// NaN never compares as better, so voids drop out by themselves.
template <class Better>
float best_of(const Neighbourhood& posts, const Better& better) {
  float best = kVoidHeight;
  for (std::int32_t dj = -1; dj <= 1; ++dj) {
    for (std::int32_t di = -1; di <= 1; ++di) {
      const float height_m = posts.at(di, dj);
      if (better(height_m, best) || (std::isnan(best) && !std::isnan(height_m))) best = height_m;
    }
  }
  return best;
}

float reduced(const Neighbourhood& posts, Reduction reduction) {
  switch (reduction) {
    case Reduction::kMean:
      return mean_of(posts);
    case Reduction::kSubsample:
      return posts.at(0, 0);
    case Reduction::kMax:
      return best_of(posts, [](float a, float b) { return a > b; });
    case Reduction::kMin:
      return best_of(posts, [](float a, float b) { return a < b; });
  }
  return kVoidHeight;
}

}  // namespace

void reduce_block(const LatticeStore& store, const TilingScheme& scheme, const BlockKey& block,
                  Reduction reduction, std::span<float> out) {
  QMPIPE_CHECK(out.size() == kBlockSize);
  const Lattice finer(scheme, block.zoom + 1);
  const Lattice coarse(scheme, block.zoom);
  const PostWindow window = {.i0 = 2 * first_post_of_block(block.x) - 1,
                             .j0 = 2 * first_post_of_block(block.y) - 1,
                             .width_posts = 2 * kBlockPosts + 1,
                             .height_posts = 2 * kBlockPosts + 1};
  std::vector<float> heights_m(window.size());
  store.read(finer, window, heights_m);
  for (std::int32_t j = 0; j < kBlockPosts; ++j) {
    float* row = out.data() + static_cast<std::ptrdiff_t>(j) * kBlockPosts;
    if (!coarse.has_row(first_post_of_block(block.y) + j)) {
      std::fill(row, row + kBlockPosts, kVoidHeight);
      continue;
    }
    const float* centre = heights_m.data() + (std::ptrdiff_t{2} * j + 1) * window.width_posts + 1;
    for (std::int32_t i = 0; i < kBlockPosts; ++i) {
      row[i] = reduced({.centre = centre + std::ptrdiff_t{2} * i, .row_stride = window.width_posts},
                       reduction);
    }
  }
}

}  // namespace qmpipe
