// How the memory of a run is shared out, decided once before work starts.
//
// The promise `--memory` is for the whole process: the program itself, GDAL's block cache, the cache
// of decoded source blocks, the lattice store and the tiles in flight. A budget that cannot work is
// refused with the smallest that can, instead of being exceeded later.
#pragma once

#include <cstdint>

namespace qmpipe {

struct MemoryNeeds {
  std::int32_t threads = 1;
  // What the lattice of all zooms takes at most.
  std::int64_t lattice_bytes = 0;
  // The sources' largest block, as the cache holds it.
  std::int64_t source_block_bytes = 0;
  // With so much cache each block is decoded about once; more would not be used.
  std::int64_t source_front_bytes = 0;
  // What one thread's handles on the sources keep for themselves.
  std::int64_t source_handle_bytes = 0;
  // What a thread holds while it simplifies a tile, beyond kTileInFlightBytes.
  std::int64_t simplify_bytes = 0;
  // Per tile of the plan, for its keys, ranges and statistics.
  std::int64_t tiles = 0;
  // What the output holds, however many tiles are in flight.
  std::int64_t output_bytes = 0;
};

struct MemoryPlan {
  bool fits = false;
  std::int64_t smallest_limit_bytes = 0;  // the least --memory that works
  std::int64_t source_cache_bytes = 0;
  // Threads that may sample at a time; all may mesh.
  std::int32_t sampling_threads = 0;
  std::int32_t max_in_flight = 0;
  std::int64_t expected_peak_bytes = 0;
};

// What the process takes before it does anything (code, libraries, PROJ's database), and what its heap
// keeps of what was freed.
inline constexpr std::int64_t kProgramBytes = 88LL << 20U;
// One tile with its window, heap of candidates, mesh and bytes, at the most vertices it can have.
inline constexpr std::int64_t kTileInFlightBytes = 8LL << 20U;
// What a thread holds while it samples: a source window in doubles, anchors, a block of posts.
inline constexpr std::int64_t kSamplingBytesPerThread = 12LL << 20U;
// GDAL's own block cache: what goes round it needs none, the rest a few blocks.
inline constexpr std::int64_t kGdalCacheBytes = 8LL << 20U;

// REQUIRES: needs.threads >= 1. `limit_bytes` 0 means no limit: a comfortable plan.
MemoryPlan plan_memory(std::int64_t limit_bytes, const MemoryNeeds& needs);

}  // namespace qmpipe
