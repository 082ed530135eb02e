#include <algorithm>
#include <cmath>
#include <limits>
#include <mutex>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include "formats/lattice_store.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::size_t kBlockSize =
    static_cast<std::size_t>(kBlockPosts) * static_cast<std::size_t>(kBlockPosts);
constexpr float kVoid = std::numeric_limits<float>::quiet_NaN();

class MemoryLatticeStore final : public LatticeStore {
 public:
  MemoryLatticeStore(TilingScheme scheme, std::int32_t max_zoom)
      : scheme_(scheme), max_zoom_(max_zoom) {}

  void put_block(std::int32_t zoom, std::int32_t bx, std::int32_t by,
                 std::span<const float> heights_m) override {
    QMPIPE_CHECK(heights_m.size() == kBlockSize && zoom >= 0 && zoom <= max_zoom_);
    QMPIPE_CHECK(bx >= 0 && bx < scheme_.columns(zoom) && by >= 0 && by <= scheme_.rows(zoom));
    const TileKey key = {.zoom = zoom, .x = bx, .y = by};
    if (std::all_of(heights_m.begin(), heights_m.end(), [](float h) { return std::isnan(h); })) {
      const std::scoped_lock lock(mutex_);
      blocks_.erase(key);
      return;
    }
    std::vector<float> block(heights_m.begin(), heights_m.end());
    const std::scoped_lock lock(mutex_);
    blocks_.insert_or_assign(key, std::move(block));
  }

  bool has_block(std::int32_t zoom, std::int32_t bx, std::int32_t by) const override {
    return find({.zoom = zoom, .x = bx, .y = by}) != nullptr;
  }

  void read(const Lattice& lattice, const PostWindow& window, std::span<float> out) const override {
    QMPIPE_CHECK(out.size() == window.size());
    std::fill(out.begin(), out.end(), kVoid);
    const std::int32_t j_first = std::max(window.j0, 0);
    const std::int32_t j_end = std::min(window.j0 + window.height_posts, lattice.rows());
    // Walk in runs that stay inside one block, so that the block is looked up once a run of rows.
    for (std::int32_t j = j_first; j < j_end;) {
      const std::int32_t j_stop = std::min(j_end, (j / kBlockPosts + 1) * kBlockPosts);
      for (std::int32_t k = 0; k < window.width_posts;) {
        const std::int32_t i = lattice.wrap_column(window.i0 + k);
        const std::int32_t run = std::min(window.width_posts - k, kBlockPosts - i % kBlockPosts);
        copy_run(lattice.zoom(), i, j, j_stop, run, window, k, out);
        k += run;
      }
      j = j_stop;
    }
  }

  std::int64_t memory_bytes() const override {
    const std::shared_lock lock(mutex_);
    return static_cast<std::int64_t>(blocks_.size() * kBlockSize * sizeof(float));
  }

 private:
  const std::vector<float>* find(const TileKey& key) const {
    const std::shared_lock lock(mutex_);
    const auto it = blocks_.find(key);
    return it == blocks_.end() ? nullptr : &it->second;
  }

  void copy_run(std::int32_t zoom, std::int32_t i, std::int32_t j_first, std::int32_t j_stop,
                std::int32_t run, const PostWindow& window, std::int32_t k,
                std::span<float> out) const {
    const auto* block = find({.zoom = zoom, .x = i / kBlockPosts, .y = j_first / kBlockPosts});
    if (block == nullptr) return;
    for (std::int32_t j = j_first; j < j_stop; ++j) {
      const auto from = block->begin() + (j % kBlockPosts) * kBlockPosts + i % kBlockPosts;
      const auto to = out.begin() + static_cast<std::ptrdiff_t>(j - window.j0) * window.width_posts;
      std::copy(from, from + run, to + k);
    }
  }

  TilingScheme scheme_;
  std::int32_t max_zoom_;
  mutable std::shared_mutex mutex_;
  // Node-based: a block's address stays while others are added.
  std::unordered_map<TileKey, std::vector<float>, TileKeyHash> blocks_;
};

}  // namespace

std::unique_ptr<LatticeStore> make_memory_lattice_store(TilingScheme scheme,
                                                        std::int32_t max_zoom) {
  return std::make_unique<MemoryLatticeStore>(scheme, max_zoom);
}

}  // namespace qmpipe
