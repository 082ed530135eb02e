// Going one zoom coarser: 2:1 reduction of the lattice over valid posts.
#pragma once

#include <span>

#include "formats/run_store/lattice_store.h"

namespace qmpipe {

enum class Reduction {
  kMean,       // 3 x 3 binomial weights around the post, over its valid neighbours. DEFAULT
  kSubsample,  // the post itself: every other post, as Campos et al. do
  kMax,        // highest of the 3 x 3: shoal-biased, nothing is deeper than it was sounded
  kMin,        // lowest of the 3 x 3
};

// The posts of one block of `zoom` from the store's zoom + 1; void where no post counts.
// REQUIRES: out.size() == kBlockPosts * kBlockPosts.
void reduce_block(const LatticeStore& store, const TilingScheme& scheme, std::int32_t zoom,
                  std::int32_t bx, std::int32_t by, Reduction reduction, std::span<float> out);

}  // namespace qmpipe
