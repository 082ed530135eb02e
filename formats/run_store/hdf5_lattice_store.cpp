#include "formats/run_store/hdf5_lattice_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <shared_mutex>
#include <unordered_map>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/recent_cache.h"
#include "formats/hdf5/handle.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/block_codec.h"
#include "formats/run_store/lattice_segment.h"
#include "formats/run_store/lattice_window.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

// HDF5 needs a time for finding n chunks that grows with n * n; flat sea packs into tens of bytes.
constexpr std::size_t kFullSegmentBlocks = 1024;
// A node of a hash map and its bucket.
constexpr std::int64_t kIndexEntryBytes = 112;

class Hdf5LatticeStore final : public LatticeStore {
 public:
  Hdf5LatticeStore(fs::path folder, const TilingScheme& scheme, const Hdf5LatticeOptions& options)
      : folder_(std::move(folder)),
        scheme_(scheme),
        options_(options),
        codec_(options.compression_level),
        cache_(options.cache_bytes, kBlockBytes) {}
  ~Hdf5LatticeStore() override;
  Hdf5LatticeStore(const Hdf5LatticeStore&) = delete;
  Hdf5LatticeStore& operator=(const Hdf5LatticeStore&) = delete;

  // REQUIRES: segments are loaded in the order of their numbers, before anything else.
  std::optional<Error> load_segment(std::int32_t number);

  void put_block(const BlockKey& key, std::span<const float> heights_m) override;
  bool has_block(const BlockKey& key) const override;
  void read(const Lattice& lattice, const PostWindow& window, std::span<float> out) const override {
    read_window(
        lattice, window, [this](const BlockKey& key) { return block_at(key); }, out);
  }
  void seal() override { write_segment(When::kAlways); }
  std::int64_t memory_bytes() const override;

 private:
  enum class When { kFull, kAlways };
  // Every put has a version of its own; it is the block's name in the cache.
  struct Pending {
    std::uint64_t version = 0;
    std::shared_ptr<const PackedBlock> block;
  };
  struct Stored {
    std::uint64_t version = 0;
    std::uint64_t content_hash = 0;
    ByteRange chunk;
    std::int32_t segment = 0;
  };
  class WritingMark;

  static std::int64_t bytes_of(const PackedBlock& block) {
    return static_cast<std::int64_t>(sizeof(PackedBlock) + block.chunk.size());
  }
  bool is_known(const BlockKey& key) const;
  void add_pending(std::shared_ptr<const PackedBlock> block);
  bool is_full() const;
  std::vector<Pending> take_batch(When when);
  void write_segment(When when);
  void settle(const std::vector<Pending>& batch, const std::vector<SegmentEntry>& entries);
  BlockHeights block_at(const BlockKey& key) const;
  BlockHeights unpack(const BlockKey& key, std::span<const std::uint8_t> chunk,
                      const fs::path& from) const;
  BlockHeights load_block(const BlockKey& key, const Stored& stored) const;

  const fs::path folder_;
  const TilingScheme scheme_;
  const Hdf5LatticeOptions options_;
  const BlockCodec codec_;
  mutable RecentCache<std::vector<float>> cache_;

  // One segment at a time; taken before mutex_.
  std::mutex write_mutex_;
  std::int32_t next_segment_ = 0;

  mutable std::shared_mutex mutex_;
  std::uint64_t last_version_ = 0;
  std::unordered_map<BlockKey, Pending, TileKeyHash> pending_;
  std::unordered_map<BlockKey, Stored, TileKeyHash> stored_;
  std::int64_t pending_bytes_ = 0;
  // The part of pending_ that is just being written.
  std::int64_t writing_bytes_ = 0;
  std::size_t writing_blocks_ = 0;
};

// Whatever way writing ends, the blocks no longer count as being written.
class Hdf5LatticeStore::WritingMark {
 public:
  explicit WritingMark(Hdf5LatticeStore& store) : store_(store) {}
  ~WritingMark() {
    const std::scoped_lock lock(store_.mutex_);
    store_.writing_bytes_ = 0;
    store_.writing_blocks_ = 0;
  }
  WritingMark(const WritingMark&) = delete;
  WritingMark& operator=(const WritingMark&) = delete;

 private:
  Hdf5LatticeStore& store_;
};

Hdf5LatticeStore::~Hdf5LatticeStore() {
  try {
    seal();
  } catch (const std::exception&) {
    // Whoever needs to know called seal(); here nobody can be told.
  }
}

std::optional<Error> Hdf5LatticeStore::load_segment(std::int32_t number) {
  const auto entries = read_lattice_segment(segment_path(folder_, SegmentKind::kLattice, number),
                                            scheme_, options_.max_zoom);
  if (!entries) return entries.error();
  for (const SegmentEntry& entry : *entries) {
    if (entry.chunk.bytes == 0) {
      stored_.erase(entry.key);
      continue;
    }
    stored_.insert_or_assign(entry.key, Stored{.version = ++last_version_,
                                               .content_hash = entry.content_hash,
                                               .chunk = entry.chunk,
                                               .segment = number});
  }
  next_segment_ = number + 1;
  return std::nullopt;
}

// REQUIRES: mutex_ is held.
bool Hdf5LatticeStore::is_known(const BlockKey& key) const {
  return pending_.contains(key) || stored_.contains(key);
}

// REQUIRES: mutex_ is held.
bool Hdf5LatticeStore::is_full() const {
  return pending_bytes_ - writing_bytes_ >= options_.segment_bytes ||
         pending_.size() >= writing_blocks_ + kFullSegmentBlocks;
}

// REQUIRES: mutex_ is held.
void Hdf5LatticeStore::add_pending(std::shared_ptr<const PackedBlock> block) {
  Pending& slot = pending_[block->key];
  if (slot.block != nullptr) pending_bytes_ -= bytes_of(*slot.block);
  pending_bytes_ += bytes_of(*block);
  slot = {.version = ++last_version_, .block = std::move(block)};
}

void Hdf5LatticeStore::put_block(const BlockKey& key, std::span<const float> heights_m) {
  QMPIPE_CHECK(heights_m.size() == kBlockSize && is_block_of(scheme_, options_.max_zoom, key));
  const bool is_void = is_all_void(heights_m);
  auto block = std::make_shared<PackedBlock>();
  block->key = key;
  if (!is_void) block->chunk = codec_.compress(heights_m);
  block->content_hash = content_hash(key, block->chunk);
  bool full = false;
  {
    const std::scoped_lock lock(mutex_);
    // Recorded even when it only hides a block that is still pending: that one may be on its way
    // to a segment.
    if (is_void && !is_known(key)) return;
    add_pending(std::move(block));
    full = is_full();
  }
  if (full) write_segment(When::kFull);
}

bool Hdf5LatticeStore::has_block(const BlockKey& key) const {
  const std::shared_lock lock(mutex_);
  const auto it = pending_.find(key);
  return it != pending_.end() ? !it->second.block->chunk.empty() : stored_.contains(key);
}

std::vector<Hdf5LatticeStore::Pending> Hdf5LatticeStore::take_batch(When when) {
  std::vector<Pending> batch;
  const std::scoped_lock lock(mutex_);
  // Another thread may have written it while this one waited.
  if (when == When::kFull && !is_full()) return batch;
  for (const auto& [key, pending] : pending_) batch.push_back(pending);
  writing_bytes_ = pending_bytes_;
  writing_blocks_ = pending_.size();
  std::sort(batch.begin(), batch.end(),
            [](const Pending& a, const Pending& b) { return a.block->key < b.block->key; });
  return batch;
}

void Hdf5LatticeStore::write_segment(When when) {
  const std::scoped_lock writing(write_mutex_);
  const WritingMark mark(*this);
  const std::vector<Pending> batch = take_batch(when);
  if (batch.empty()) return;
  std::vector<std::shared_ptr<const PackedBlock>> blocks;
  for (const Pending& pending : batch) blocks.push_back(pending.block);
  const fs::path path = segment_path(folder_, SegmentKind::kLattice, next_segment_);
  const EncodedSegment segment = encode_lattice_segment(path, scheme_, blocks);
  write_file_durably(path, segment.bytes);
  settle(batch, segment.entries);
  ++next_segment_;
}

void Hdf5LatticeStore::settle(const std::vector<Pending>& batch,
                              const std::vector<SegmentEntry>& entries) {
  const std::scoped_lock lock(mutex_);
  for (std::size_t k = 0; k < batch.size(); ++k) {
    const BlockKey& key = batch[k].block->key;
    if (entries[k].chunk.bytes == 0) {
      stored_.erase(key);
    } else {
      stored_.insert_or_assign(key, Stored{.version = batch[k].version,
                                           .content_hash = entries[k].content_hash,
                                           .chunk = entries[k].chunk,
                                           .segment = next_segment_});
    }
    // Put again meanwhile: the newer one stays pending.
    const auto it = pending_.find(key);
    if (it == pending_.end() || it->second.version != batch[k].version) continue;
    pending_bytes_ -= bytes_of(*it->second.block);
    pending_.erase(it);
  }
}

BlockHeights Hdf5LatticeStore::unpack(const BlockKey& key, std::span<const std::uint8_t> chunk,
                                      const fs::path& from) const {
  Result<std::vector<float>> heights_m = codec_.decompress(chunk);
  if (!heights_m) {
    throw IoError(fmt::format("cannot read block {} of", to_string(key)), from.string(),
                  heights_m.error().message, "");
  }
  return std::make_shared<const std::vector<float>>(std::move(*heights_m));
}

BlockHeights Hdf5LatticeStore::load_block(const BlockKey& key, const Stored& stored) const {
  const fs::path path = segment_path(folder_, SegmentKind::kLattice, stored.segment);
  const auto chunk = read_file_range(path, stored.chunk.offset, stored.chunk.bytes);
  const bool is_damaged = chunk && content_hash(key, *chunk) != stored.content_hash;
  if (!chunk || is_damaged) {
    throw IoError(fmt::format("cannot read block {} of", to_string(key)), path.string(),
                  is_damaged ? "its bytes are not those that were written" : chunk.error().message,
                  kSegmentChanged);
  }
  return unpack(key, *chunk, path);
}

BlockHeights Hdf5LatticeStore::block_at(const BlockKey& key) const {
  std::shared_ptr<const PackedBlock> pending;
  Stored stored;
  {
    const std::shared_lock lock(mutex_);
    if (const auto it = pending_.find(key); it != pending_.end()) {
      pending = it->second.block;
      stored.version = it->second.version;
      if (pending->chunk.empty()) return nullptr;
    } else if (const auto at = stored_.find(key); at != stored_.end()) {
      stored = at->second;
    } else {
      return nullptr;
    }
  }
  if (BlockHeights cached = cache_.find(stored.version)) return cached;
  BlockHeights heights_m =
      pending != nullptr ? unpack(key, pending->chunk, folder_) : load_block(key, stored);
  cache_.add(stored.version, heights_m);
  return heights_m;
}

std::int64_t Hdf5LatticeStore::memory_bytes() const {
  const std::shared_lock lock(mutex_);
  const auto blocks = static_cast<std::int64_t>(pending_.size() + stored_.size());
  // The file under way exists twice: as HDF5 builds it, and as it is written.
  return cache_.memory_bytes() + pending_bytes_ + 2 * writing_bytes_ + blocks * kIndexEntryBytes;
}

}  // namespace

Result<std::unique_ptr<LatticeStore>> open_hdf5_lattice_store(const fs::path& folder,
                                                              const TilingScheme& scheme,
                                                              const Hdf5LatticeOptions& options) {
  QMPIPE_CHECK(options.max_zoom >= 0 && options.max_zoom <= kMaxZoom);
  require_thread_safe_hdf5(folder);
  prepare_segment_folder(folder, SegmentKind::kLattice);
  const auto count = count_without_gaps(folder, SegmentKind::kLattice);
  if (!count) return count.error();
  auto store = std::make_unique<Hdf5LatticeStore>(folder, scheme, options);
  for (std::int32_t number = 0; number < *count; ++number) {
    if (const auto error = store->load_segment(number)) return *error;
  }
  return std::unique_ptr<LatticeStore>(std::move(store));
}

std::int64_t lattice_store_memory_bytes(const Hdf5LatticeOptions& options, std::int64_t blocks) {
  return 3 * options.segment_bytes + options.cache_bytes + blocks * kIndexEntryBytes;
}

std::int32_t count_lattice_segments(const fs::path& folder) {
  return static_cast<std::int32_t>(segment_numbers(folder, SegmentKind::kLattice).size());
}

}  // namespace qmpipe
