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

// The block's posts from the store's next zoom; void where no post counts. REQUIRES: out.size() == kBlockSize.
void reduce_block(const LatticeStore& store, const TilingScheme& scheme, const BlockKey& block,
                  Reduction reduction, std::span<float> out);

}  // namespace qmpipe
