#include <array>
#include <mutex>
#include <unordered_map>

#include "formats/run_store/border_store.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// A node of a hash map and its bucket.
constexpr std::int64_t kBorderBytesInMemory = 88;

class MemoryBorderStore final : public BorderStore {
 public:
  void publish(const TileKey& owner, Side side, const BorderMask& mask) override {
    const std::scoped_lock lock(mutex_);
    const bool is_new = borders_.at(index_of(side)).emplace(owner, mask).second;
    QMPIPE_CHECK(is_new);
  }

  BorderMask take(const TileKey& owner, Side side) override {
    const std::scoped_lock lock(mutex_);
    auto& borders = borders_.at(index_of(side));
    const auto it = borders.find(owner);
    QMPIPE_CHECK(it != borders.end());
    const BorderMask mask = it->second;
    borders.erase(it);
    return mask;
  }

  void seal() override {}

  std::int64_t size() const override {
    const std::scoped_lock lock(mutex_);
    std::int64_t n = 0;
    for (const auto& borders : borders_) n += static_cast<std::int64_t>(borders.size());
    return n;
  }

  std::int64_t memory_bytes() const override { return size() * kBorderBytesInMemory; }

 private:
  mutable std::mutex mutex_;
  std::array<std::unordered_map<TileKey, BorderMask, TileKeyHash>, 4> borders_;
};

}  // namespace

std::unique_ptr<BorderStore> make_memory_border_store() {
  return std::make_unique<MemoryBorderStore>();
}

}  // namespace qmpipe
