#include <iterator>
#include <mutex>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "formats/run_store/lattice_window.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

class MemoryLatticeStore final : public LatticeStore {
 public:
  MemoryLatticeStore(TilingScheme scheme, std::int32_t max_zoom)
      : scheme_(scheme), max_zoom_(max_zoom) {}

  void put_block(const BlockKey& key, std::span<const float> heights_m) override {
    QMPIPE_CHECK(heights_m.size() == kBlockSize && is_block_of(scheme_, max_zoom_, key));
    if (is_all_void(heights_m)) {
      const std::scoped_lock lock(mutex_);
      blocks_.erase(key);
      return;
    }
    auto block = std::make_shared<const std::vector<float>>(heights_m.begin(), heights_m.end());
    const std::scoped_lock lock(mutex_);
    blocks_.insert_or_assign(key, std::move(block));
  }

  bool has_block(const BlockKey& key) const override { return find(key) != nullptr; }

  void read(const Lattice& lattice, const PostWindow& window, std::span<float> out) const override {
    read_window(
        lattice, window, [this](const BlockKey& key) { return find(key); }, out);
  }

  void seal() override {}

  std::int64_t memory_bytes() const override {
    const std::shared_lock lock(mutex_);
    return std::ssize(blocks_) * kBlockBytes;
  }

 private:
  BlockHeights find(const BlockKey& key) const {
    const std::shared_lock lock(mutex_);
    const auto it = blocks_.find(key);
    return it == blocks_.end() ? nullptr : it->second;
  }

  TilingScheme scheme_;
  std::int32_t max_zoom_;
  mutable std::shared_mutex mutex_;
  std::unordered_map<BlockKey, BlockHeights, TileKeyHash> blocks_;
};

}  // namespace

std::unique_ptr<LatticeStore> make_memory_lattice_store(TilingScheme scheme,
                                                        std::int32_t max_zoom) {
  return std::make_unique<MemoryLatticeStore>(scheme, max_zoom);
}

}  // namespace qmpipe
