// What was read last, within a bound of bytes.
//
// Values are named by a number that is different for every content, so that nothing in the cache is
// ever out of date. What was handed out stays valid when it leaves the cache.
#pragma once

#include <algorithm>
#include <cstdint>
#include <list>
#include <memory>
#include <mutex>
#include <unordered_map>
#include <utility>

namespace qmpipe {

// Safe to use from several threads at once.
template <class Value>
class RecentCache {
 public:
  using Shared = std::shared_ptr<const Value>;

  // All values count as value_bytes. A bound below one value keeps nothing. REQUIRES: value_bytes
  // > 0.
  RecentCache(std::int64_t bound_bytes, std::int64_t value_bytes)
      : value_bytes_(value_bytes),
        capacity_(static_cast<std::size_t>(std::max<std::int64_t>(0, bound_bytes / value_bytes))) {}

  // Null when it is not there.
  Shared find(std::uint64_t name) {
    const std::scoped_lock lock(mutex_);
    const auto it = index_.find(name);
    if (it == index_.end()) return nullptr;
    entries_.splice(entries_.begin(), entries_, it->second);
    return it->second->value;
  }

  // Lets go of what was asked for longest ago, first.
  void add(std::uint64_t name, Shared value) {
    if (capacity_ == 0) return;
    const std::scoped_lock lock(mutex_);
    // Two threads may have missed the same value.
    if (index_.contains(name)) return;
    if (entries_.size() >= capacity_) {
      index_.erase(entries_.back().name);
      entries_.pop_back();
    }
    entries_.push_front({.name = name, .value = std::move(value)});
    index_.emplace(name, entries_.begin());
  }

  // Never above the bound.
  std::int64_t memory_bytes() const {
    const std::scoped_lock lock(mutex_);
    return static_cast<std::int64_t>(entries_.size()) * value_bytes_;
  }

 private:
  struct Entry {
    std::uint64_t name = 0;
    Shared value;
  };
  const std::int64_t value_bytes_;
  const std::size_t capacity_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // last asked for first
  std::unordered_map<std::uint64_t, typename std::list<Entry>::iterator> index_;
};

}  // namespace qmpipe
