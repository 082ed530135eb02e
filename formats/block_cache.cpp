#include "formats/block_cache.h"

#include <algorithm>

namespace qmpipe {
namespace {

constexpr auto kBlockBytes = static_cast<std::int64_t>(kBlockSize * sizeof(float));

}  // namespace

BlockCache::BlockCache(std::int64_t bound_bytes)
    : capacity_blocks_(
          static_cast<std::size_t>(std::max<std::int64_t>(0, bound_bytes / kBlockBytes))) {}

BlockHeights BlockCache::find(std::uint64_t version) {
  const std::scoped_lock lock(mutex_);
  const auto it = index_.find(version);
  if (it == index_.end()) return nullptr;
  entries_.splice(entries_.begin(), entries_, it->second);
  return it->second->heights_m;
}

void BlockCache::add(std::uint64_t version, BlockHeights heights_m) {
  if (capacity_blocks_ == 0) return;
  const std::scoped_lock lock(mutex_);
  // Two threads may have missed the same block.
  if (index_.contains(version)) return;
  if (entries_.size() >= capacity_blocks_) {
    index_.erase(entries_.back().version);
    entries_.pop_back();
  }
  entries_.push_front({.version = version, .heights_m = std::move(heights_m)});
  index_.emplace(version, entries_.begin());
}

std::int64_t BlockCache::memory_bytes() const {
  const std::scoped_lock lock(mutex_);
  return static_cast<std::int64_t>(entries_.size()) * kBlockBytes;
}

}  // namespace qmpipe
