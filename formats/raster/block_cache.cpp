#include "formats/raster/block_cache.h"

#include <array>
#include <atomic>
#include <condition_variable>
#include <limits>
#include <list>
#include <mutex>
#include <unordered_map>
#include <utility>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Bytes = SourceBlockCache::Bytes;

// Many threads ask for the strips of a file hundreds of times per block of posts.
constexpr std::size_t kShards = 16;

struct SourceBlockKey {
  std::uint32_t source = 0;
  std::int64_t index = 0;
  bool operator==(const SourceBlockKey&) const = default;
  // Neighbours in a file are in different shards.
  std::size_t shard() const { return (static_cast<std::size_t>(index) + source) % kShards; }
};

struct SourceBlockKeyHash {
  std::size_t operator()(const SourceBlockKey& key) const {
    return (static_cast<std::size_t>(key.index) + (static_cast<std::size_t>(key.source) << 40U)) *
           0x9E3779B97F4A7C15ULL;
  }
};

struct Entry {
  SourceBlockKey key;
  std::shared_ptr<const Bytes> bytes;  // null while a thread decodes it
  std::uint64_t asked_at = 0;
};

}  // namespace

struct SourceBlockCache::Impl {
  struct Shard {
    std::mutex mutex;
    std::condition_variable ready;
    std::list<Entry> entries;  // last asked for first
    std::unordered_map<SourceBlockKey, std::list<Entry>::iterator, SourceBlockKeyHash> index;
    // By source: which blocks of this shard were decoded before.
    std::unordered_map<std::uint32_t, std::vector<bool>> known;

    // REQUIRES for all: the mutex is held.
    std::list<Entry>::iterator oldest_idle();
    bool note_first(const SourceBlockKey& key);
    void erase(std::list<Entry>::iterator entry);
  };

  class Claim;

  explicit Impl(std::int64_t bound) : bound_bytes(bound) {}

  bool let_go_of_oldest();
  // For one more block.
  void make_room(std::int64_t size_bytes);

  const std::int64_t bound_bytes;
  std::array<Shard, kShards> shards;
  std::atomic<std::uint64_t> clock = 0;
  std::atomic<std::int64_t> held_bytes = 0;
  std::atomic<std::int64_t> blocks = 0;
  std::atomic<std::int64_t> decoded_blocks = 0;
  std::atomic<std::int64_t> decoded_bytes = 0;
};

// A block that this thread decodes; when that fails, the block is as if nobody had asked for it.
class SourceBlockCache::Impl::Claim {
 public:
  Claim(Impl& cache, Shard& shard, SourceBlockKey key, std::int64_t size_bytes)
      : cache_(cache), shard_(shard), key_(key), size_bytes_(size_bytes) {}
  ~Claim() {
    if (is_kept_) return;
    if (is_counted_) cache_.held_bytes.fetch_sub(size_bytes_);
    {
      const std::scoped_lock lock(shard_.mutex);
      shard_.erase(shard_.index.at(key_));
    }
    shard_.ready.notify_all();
  }
  Claim(const Claim&) = delete;
  Claim& operator=(const Claim&) = delete;

  // Once there is room, and not before: a block that waits for room is not held.
  void count() {
    is_counted_ = true;
    cache_.held_bytes.fetch_add(size_bytes_);
  }

  void keep(std::shared_ptr<const Bytes> bytes, std::int64_t file_blocks) {
    is_kept_ = true;
    cache_.decoded_blocks.fetch_add(file_blocks, std::memory_order_relaxed);
    cache_.decoded_bytes.fetch_add(size_bytes_, std::memory_order_relaxed);
    {
      const std::scoped_lock lock(shard_.mutex);
      shard_.index.at(key_)->bytes = std::move(bytes);
      if (shard_.note_first(key_)) {
        cache_.blocks.fetch_add(file_blocks, std::memory_order_relaxed);
      }
    }
    shard_.ready.notify_all();
  }

 private:
  Impl& cache_;
  Shard& shard_;
  SourceBlockKey key_;
  std::int64_t size_bytes_;
  bool is_counted_ = false;
  bool is_kept_ = false;
};

// Neither in work nor in a reader's hand: letting go of it gives memory back. Bytes are handed out
// under the mutex only, so that nobody takes them up in between.
std::list<Entry>::iterator SourceBlockCache::Impl::Shard::oldest_idle() {
  for (auto it = entries.end(); it != entries.begin();) {
    --it;
    if (it->bytes && it->bytes.use_count() == 1) return it;
  }
  return entries.end();
}

bool SourceBlockCache::Impl::Shard::note_first(const SourceBlockKey& key) {
  std::vector<bool>& marks = known[key.source];
  const std::size_t at = static_cast<std::size_t>(key.index) / kShards;
  if (at >= marks.size()) marks.resize(at + 1);
  const bool is_first = !marks[at];
  marks[at] = true;
  return is_first;
}

void SourceBlockCache::Impl::Shard::erase(std::list<Entry>::iterator entry) {
  index.erase(entry->key);
  entries.erase(entry);
}

// False when there is nothing to let go of.
bool SourceBlockCache::Impl::let_go_of_oldest() {
  Shard* oldest = nullptr;
  std::uint64_t asked_at = std::numeric_limits<std::uint64_t>::max();
  for (Shard& shard : shards) {
    const std::scoped_lock lock(shard.mutex);
    const auto entry = shard.oldest_idle();
    if (entry == shard.entries.end() || entry->asked_at >= asked_at) continue;
    asked_at = entry->asked_at;
    oldest = &shard;
  }
  if (oldest == nullptr) return false;
  std::shared_ptr<const Bytes> freed;  // outside the lock
  const std::scoped_lock lock(oldest->mutex);
  const auto entry = oldest->oldest_idle();
  // Another thread was quicker: there may be more.
  if (entry == oldest->entries.end()) return true;
  held_bytes.fetch_sub(static_cast<std::int64_t>(entry->bytes->size()));
  freed = std::move(entry->bytes);
  oldest->erase(entry);
  return true;
}

void SourceBlockCache::Impl::make_room(std::int64_t size_bytes) {
  while (held_bytes.load() + size_bytes > bound_bytes && let_go_of_oldest()) {
  }
}

SourceBlockCache::SourceBlockCache(std::int64_t bound_bytes)
    : impl_(std::make_unique<Impl>(bound_bytes)) {}
SourceBlockCache::~SourceBlockCache() = default;

std::shared_ptr<const Bytes> SourceBlockCache::get(
    const Request& request, const std::function<void(std::span<std::uint8_t>)>& decode) {
  QMPIPE_CHECK(request.index >= 0 && request.size_bytes > 0 && request.file_blocks > 0);
  const SourceBlockKey key{.source = request.source, .index = request.index};
  Impl::Shard& shard = impl_->shards[key.shard()];
  {
    std::unique_lock lock(shard.mutex);
    for (auto found = shard.index.find(key); found != shard.index.end();
         found = shard.index.find(key)) {
      const auto entry = found->second;
      if (entry->bytes) {
        entry->asked_at = impl_->clock.fetch_add(1, std::memory_order_relaxed);
        shard.entries.splice(shard.entries.begin(), shard.entries, entry);
        return entry->bytes;
      }
      shard.ready.wait(lock);
    }
    shard.entries.push_front({.key = key, .bytes = nullptr, .asked_at = impl_->clock.fetch_add(1)});
    shard.index.emplace(key, shard.entries.begin());
  }
  Impl::Claim claim(*impl_, shard, key, request.size_bytes);
  impl_->make_room(request.size_bytes);
  claim.count();
  auto bytes = std::make_shared<Bytes>(static_cast<std::size_t>(request.size_bytes));
  decode(*bytes);
  std::shared_ptr<const Bytes> result = std::move(bytes);
  claim.keep(result, request.file_blocks);
  return result;
}

SourceReads SourceBlockCache::reads() const {
  return {.blocks = impl_->blocks.load(),
          .decoded_blocks = impl_->decoded_blocks.load(),
          .decoded_bytes = impl_->decoded_bytes.load()};
}

std::int64_t SourceBlockCache::memory_bytes() const { return impl_->held_bytes.load(); }

}  // namespace qmpipe
