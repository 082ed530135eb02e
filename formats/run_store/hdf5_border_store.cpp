#include "formats/run_store/hdf5_border_store.h"

#include <fmt/format.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <unordered_map>
#include <utility>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/recent_cache.h"
#include "formats/hdf5/handle.h"
#include "formats/hdf5/segment_files.h"
#include "formats/run_store/border_segment.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr auto kChunkMemoryBytes = static_cast<std::int64_t>(kMaxChunkBorders * sizeof(Border));
// A node of a hash map and its bucket.
constexpr std::int64_t kPendingBytes = 96;

struct BorderKeyHash {
  std::size_t operator()(const BorderKey& key) const noexcept {
    return static_cast<std::size_t>(packed(key) * 0x9E3779B97F4A7C15ULL >> 7U);
  }
};

class Hdf5BorderStore final : public BorderStore {
 public:
  Hdf5BorderStore(fs::path folder, const TilingScheme& scheme, const Hdf5BorderOptions& options)
      : folder_(std::move(folder)),
        scheme_(scheme),
        options_(options),
        cache_(options.cache_bytes, kChunkMemoryBytes) {}

  // REQUIRES: segments are loaded in the order of their numbers, before anything else.
  std::optional<Error> load_segment();

  void publish(const TileKey& owner, Side side, const BorderMask& mask) override;
  BorderMask take(const TileKey& owner, Side side) override;
  void seal() override;
  std::int64_t size() const override;
  std::int64_t memory_bytes() const override;

 private:
  using Chunk = std::vector<Border>;
  enum class Origin { kEarlierRun, kThisRun };
  // Since the last seal. Stays when it is taken: its heir may be made again after a kill.
  struct Pending {
    BorderMask mask;
    bool is_taken = false;
  };
  // Its number is its place in segments_.
  struct Segment {
    Origin origin = Origin::kThisRun;
    std::vector<BorderChunk> chunks;
  };
  // A chunk that may have a border.
  struct Candidate {
    std::size_t segment = 0;
    std::size_t index = 0;
    Origin origin = Origin::kThisRun;
    BorderChunk chunk;
  };
  class WritingMark;

  fs::path path_of(std::size_t segment) const {
    return segment_path(folder_, SegmentKind::kBorders, static_cast<std::int32_t>(segment));
  }
  std::vector<Border> copy_batch();
  void settle(const std::vector<Border>& batch, std::vector<BorderChunk> chunks);
  std::optional<BorderMask> take_pending(const BorderKey& key);
  std::vector<Candidate> candidates_for(const BorderKey& key) const;
  std::shared_ptr<const Chunk> load(const Candidate& candidate);

  const fs::path folder_;
  const TilingScheme scheme_;
  const Hdf5BorderOptions options_;
  RecentCache<Chunk> cache_;

  // One segment at a time; taken before mutex_.
  std::mutex write_mutex_;

  mutable std::mutex mutex_;
  std::unordered_map<BorderKey, Pending, BorderKeyHash> pending_;
  std::vector<Segment> segments_;
  std::int64_t indexed_chunks_ = 0;
  std::int64_t waiting_ = 0;
  std::int64_t writing_bytes_ = 0;
};

// Whatever way writing ends, its memory is given back.
class Hdf5BorderStore::WritingMark {
 public:
  explicit WritingMark(Hdf5BorderStore& store) : store_(store) {}
  ~WritingMark() {
    const std::scoped_lock lock(store_.mutex_);
    store_.writing_bytes_ = 0;
  }
  WritingMark(const WritingMark&) = delete;
  WritingMark& operator=(const WritingMark&) = delete;

 private:
  Hdf5BorderStore& store_;
};

std::optional<Error> Hdf5BorderStore::load_segment() {
  auto chunks = read_border_segment(path_of(segments_.size()), scheme_, options_.max_zoom);
  if (!chunks) return chunks.error();
  indexed_chunks_ += std::ssize(*chunks);
  segments_.push_back({.origin = Origin::kEarlierRun, .chunks = std::move(*chunks)});
  return std::nullopt;
}

void Hdf5BorderStore::publish(const TileKey& owner, Side side, const BorderMask& mask) {
  QMPIPE_CHECK(owner.zoom >= 0 && owner.zoom <= options_.max_zoom && scheme_.contains(owner));
  const std::scoped_lock lock(mutex_);
  const bool is_new =
      pending_.emplace(BorderKey{.owner = owner, .side = side}, Pending{.mask = mask}).second;
  QMPIPE_CHECK(is_new);
  ++waiting_;
}

// REQUIRES: mutex_ is held.
std::optional<BorderMask> Hdf5BorderStore::take_pending(const BorderKey& key) {
  const auto it = pending_.find(key);
  if (it == pending_.end()) return std::nullopt;
  QMPIPE_CHECK(!it->second.is_taken);
  it->second.is_taken = true;
  --waiting_;
  return it->second.mask;
}

// The newest first; at most one of a segment. REQUIRES: mutex_ is held.
std::vector<Hdf5BorderStore::Candidate> Hdf5BorderStore::candidates_for(
    const BorderKey& key) const {
  std::vector<Candidate> candidates;
  for (std::size_t number = segments_.size(); number-- > 0;) {
    const Segment& segment = segments_[number];
    // Most segments are rows away.
    if (key < segment.chunks.front().first || key > segment.chunks.back().last) continue;
    const auto it = std::lower_bound(
        segment.chunks.begin(), segment.chunks.end(), key,
        [](const BorderChunk& chunk, const BorderKey& wanted) { return chunk.last < wanted; });
    if (it->first > key) continue;
    candidates.push_back({.segment = number,
                          .index = static_cast<std::size_t>(it - segment.chunks.begin()),
                          .origin = segment.origin,
                          .chunk = *it});
  }
  return candidates;
}

std::shared_ptr<const Hdf5BorderStore::Chunk> Hdf5BorderStore::load(const Candidate& candidate) {
  const std::uint64_t name = std::uint64_t{candidate.segment} << 32U | candidate.index;
  if (auto cached = cache_.find(name)) return cached;
  const fs::path path = path_of(candidate.segment);
  auto borders = read_border_chunk(path, candidate.chunk);
  if (!borders) {
    throw IoError(fmt::format("cannot read borders {} to {} of", to_string(candidate.chunk.first),
                              to_string(candidate.chunk.last)),
                  path.string(), borders.error().message, kSegmentChanged);
  }
  auto chunk = std::make_shared<const Chunk>(std::move(*borders));
  cache_.add(name, chunk);
  return chunk;
}

BorderMask Hdf5BorderStore::take(const TileKey& owner, Side side) {
  const BorderKey key = {.owner = owner, .side = side};
  std::vector<Candidate> candidates;
  {
    const std::scoped_lock lock(mutex_);
    if (const auto mask = take_pending(key)) return *mask;
    candidates = candidates_for(key);
  }
  for (const Candidate& candidate : candidates) {
    const std::shared_ptr<const Chunk> chunk = load(candidate);
    const auto it = std::lower_bound(
        chunk->begin(), chunk->end(), key,
        [](const Border& border, const BorderKey& wanted) { return border.key < wanted; });
    if (it == chunk->end() || it->key != key) continue;
    if (candidate.origin == Origin::kThisRun) {
      const std::scoped_lock lock(mutex_);
      --waiting_;
    }
    return it->mask;
  }
  const bool was_published = false;
  QMPIPE_CHECK(was_published);
  return {};
}

std::vector<Border> Hdf5BorderStore::copy_batch() {
  std::vector<Border> batch;
  {
    const std::scoped_lock lock(mutex_);
    batch.reserve(pending_.size());
    for (const auto& [key, pending] : pending_) {
      batch.push_back({.key = key, .mask = pending.mask});
    }
    // The batch, and the file as HDF5 builds it and as it is written.
    writing_bytes_ = 2 * std::ssize(batch) * static_cast<std::int64_t>(sizeof(Border));
  }
  std::sort(batch.begin(), batch.end(),
            [](const Border& a, const Border& b) { return a.key < b.key; });
  return batch;
}

void Hdf5BorderStore::seal() {
  const std::scoped_lock writing(write_mutex_);
  const WritingMark mark(*this);
  const std::vector<Border> batch = copy_batch();
  if (batch.empty()) return;
  // Only this function adds segments, one call at a time.
  const fs::path path = path_of(segments_.size());
  EncodedBorderSegment segment =
      encode_border_segment(path, scheme_, batch, options_.compression_level);
  write_file_durably(path, segment.bytes);
  settle(batch, std::move(segment.chunks));
}

void Hdf5BorderStore::settle(const std::vector<Border>& batch, std::vector<BorderChunk> chunks) {
  const std::scoped_lock lock(mutex_);
  indexed_chunks_ += std::ssize(chunks);
  segments_.push_back({.origin = Origin::kThisRun, .chunks = std::move(chunks)});
  for (const Border& border : batch) pending_.erase(border.key);
}

std::int64_t Hdf5BorderStore::size() const {
  const std::scoped_lock lock(mutex_);
  return waiting_;
}

std::int64_t Hdf5BorderStore::memory_bytes() const {
  const std::scoped_lock lock(mutex_);
  return cache_.memory_bytes() + std::ssize(pending_) * kPendingBytes + writing_bytes_ +
         indexed_chunks_ * static_cast<std::int64_t>(sizeof(BorderChunk)) +
         std::ssize(segments_) * static_cast<std::int64_t>(sizeof(Segment));
}

}  // namespace

Result<std::unique_ptr<BorderStore>> open_hdf5_border_store(const fs::path& folder,
                                                            const TilingScheme& scheme,
                                                            const Hdf5BorderOptions& options) {
  QMPIPE_CHECK(options.max_zoom >= 0 && options.max_zoom <= kMaxZoom);
  QMPIPE_CHECK(options.compression_level >= 1 && options.compression_level <= 19);
  require_thread_safe_hdf5(folder);
  prepare_segment_folder(folder, SegmentKind::kBorders);
  const auto count = count_without_gaps(folder, SegmentKind::kBorders);
  if (!count) return count.error();
  auto store = std::make_unique<Hdf5BorderStore>(folder, scheme, options);
  for (std::int32_t number = 0; number < *count; ++number) {
    if (const auto error = store->load_segment()) return *error;
  }
  return std::unique_ptr<BorderStore>(std::move(store));
}

std::int32_t count_border_segments(const fs::path& folder) {
  return static_cast<std::int32_t>(segment_numbers(folder, SegmentKind::kBorders).size());
}

}  // namespace qmpipe
