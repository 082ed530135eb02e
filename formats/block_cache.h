// The blocks that were read last, within a bound of bytes.
#pragma once

#include <cstdint>
#include <list>
#include <mutex>
#include <unordered_map>

#include "formats/lattice_window.h"

namespace qmpipe {

// Named by a number that is different for every content, so that nothing in it is ever out of date.
// Safe to use from several threads at once. What was handed out stays valid when it leaves the
// cache.
class BlockCache {
 public:
  // A bound below one block (256 KiB) keeps nothing.
  explicit BlockCache(std::int64_t bound_bytes);

  // Null when it is not there.
  BlockHeights find(std::uint64_t version);
  // Lets go of what was asked for longest ago, first.
  void add(std::uint64_t version, BlockHeights heights_m);
  // Never above the bound.
  std::int64_t memory_bytes() const;

 private:
  struct Entry {
    std::uint64_t version = 0;
    BlockHeights heights_m;
  };
  const std::size_t capacity_blocks_;
  mutable std::mutex mutex_;
  std::list<Entry> entries_;  // last asked for first
  std::unordered_map<std::uint64_t, std::list<Entry>::iterator> index_;
};

}  // namespace qmpipe
