// Blocks of heights and brute-force reading for the tests of lattice stores.
#pragma once

#include <bit>
#include <cmath>
#include <cstdint>
#include <limits>
#include <map>
#include <random>
#include <span>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "formats/run_store/lattice_window.h"

namespace qmpipe::testing {

inline constexpr float kVoidHeight = std::numeric_limits<float>::quiet_NaN();

// Flat, smooth with a hole, or rough: different for every seed.
inline std::vector<float> block_of_seed(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  std::vector<float> block(kBlockSize, static_cast<float>(random() % 9000));
  if (seed % 3 == 0) return block;
  for (std::size_t k = 0; k < block.size(); ++k) {
    const auto i = static_cast<float>(k % kBlockPosts);
    const auto j = static_cast<float>(k / kBlockPosts);
    block[k] +=
        seed % 3 == 1 ? 0.25F * i - 0.125F * j : static_cast<float>(random() % 65536) / 7.0F;
    if (i > 200 && j > 180) block[k] = kVoidHeight;
  }
  return block;
}

inline bool same_height(float a, float b) {
  return std::isnan(a) ? std::isnan(b)
                       : std::bit_cast<std::uint32_t>(a) == std::bit_cast<std::uint32_t>(b);
}

// What a store should hold.
class BlockModel {
 public:
  void put(const TileKey& key, const std::vector<float>& heights_m) { blocks_[key] = heights_m; }
  const std::map<TileKey, std::vector<float>>& blocks() const { return blocks_; }
  float height_m(const Lattice& lattice, std::int64_t i, std::int64_t j) const {
    if (!lattice.has_row(j)) return kVoidHeight;
    const std::int64_t column = ((i % lattice.columns()) + lattice.columns()) % lattice.columns();
    const auto it =
        blocks_.find({.zoom = lattice.zoom(), .x = block_of_post(column), .y = block_of_post(j)});
    if (it == blocks_.end()) return kVoidHeight;
    return it
        ->second[static_cast<std::size_t>((j % kBlockPosts) * kBlockPosts + column % kBlockPosts)];
  }
  // Posts of the window that the store reads differently.
  std::size_t differences(const LatticeStore& store, const Lattice& lattice,
                          const PostWindow& window) const {
    std::vector<float> out(window.size(), -1.0F);
    store.read(lattice, window, out);
    std::size_t count = 0;
    std::size_t k = 0;
    for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
      for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i, ++k) {
        if (!same_height(out[k], height_m(lattice, i, j))) ++count;
      }
    }
    return count;
  }
  // Over all blocks that were ever put.
  std::size_t differences(const LatticeStore& store, const TilingScheme& scheme) const {
    std::size_t count = 0;
    for (const auto& [key, heights_m] : blocks_) {
      count += differences(store, Lattice(scheme, key.zoom), posts_of(key));
      if (store.has_block(key) == is_all_void(heights_m)) ++count;
    }
    return count;
  }

 private:
  std::map<TileKey, std::vector<float>> blocks_;
};

}  // namespace qmpipe::testing
