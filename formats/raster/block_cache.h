// Decoded blocks of the sources, shared by all threads and all handles on one file, so that each
// block is decoded about once.
//
// Guarantees: a block is decoded by one thread while the others that want it wait for it; blocks are
// let go of in the order in which they were last asked for; the cache holds no more than its bound,
// or what the threads have in hand and in work where that is more (one block each at most, when each
// lets go of one before it asks for the next). It counts what was decoded, and how much of that for
// the first time.
// Safe to use from several threads at once. A thread that decodes must not ask for another block.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

namespace qmpipe {

// A block of the cache may stand for several blocks of the file; these are counts of the file's.
struct SourceReads {
  std::int64_t blocks = 0;          // touched, each counted once
  std::int64_t decoded_blocks = 0;  // each counted as often as it was decoded
  std::int64_t decoded_bytes = 0;   // of values and masks

  // 0 where nothing was read.
  double decoded_per_block() const {
    return blocks == 0 ? 0 : static_cast<double>(decoded_blocks) / static_cast<double>(blocks);
  }
};

class SourceBlockCache {
 public:
  using Bytes = std::vector<std::uint8_t>;

  struct Request {
    std::uint32_t source = 0;     // the same number for all handles on one file
    std::int64_t index = 0;       // of the block in its file
    std::int64_t size_bytes = 0;  // when decoded
    std::int64_t file_blocks = 1;
  };

  explicit SourceBlockCache(std::int64_t bound_bytes);
  ~SourceBlockCache();
  SourceBlockCache(const SourceBlockCache&) = delete;
  SourceBlockCache& operator=(const SourceBlockCache&) = delete;

  // The block's bytes, which stay valid when it leaves the cache; where it is not there, `decode`
  // fills them (they begin as zeros). What `decode` throws comes out of here; threads that waited
  // for the block then decode it themselves.
  std::shared_ptr<const Bytes> get(const Request& request,
                                   const std::function<void(std::span<std::uint8_t>)>& decode);

  SourceReads reads() const;
  // Of the blocks in the cache and in work.
  std::int64_t memory_bytes() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
