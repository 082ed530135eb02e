#include "scheduler/memory_budget.h"

#include <algorithm>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kPlanBytesPerTile = 160;
constexpr std::int64_t kSmallestCacheBytes = 8LL << 20U;
constexpr std::int64_t kComfortableCacheBytes = 64LL << 20U;

// Enough that every thread has work while the sink waits for the slowest tile of a chain.
constexpr std::int32_t comfortable_in_flight(std::int32_t threads) {
  return std::max(8, 4 * threads);
}

// So many tiles, of which each thread simplifies one.
std::int64_t tiles_bytes(const MemoryNeeds& needs, std::int64_t tiles) {
  return tiles * kTileInFlightBytes +
         std::min<std::int64_t>(tiles, needs.threads) * needs.simplify_bytes;
}

// The most tiles that fit the room; 0 where not one does.
std::int64_t tiles_within(const MemoryNeeds& needs, std::int64_t room_bytes) {
  const std::int64_t one_each = tiles_bytes(needs, needs.threads);
  if (room_bytes < one_each) return room_bytes / (kTileInFlightBytes + needs.simplify_bytes);
  return needs.threads + (room_bytes - one_each) / kTileInFlightBytes;
}

}  // namespace

MemoryPlan plan_memory(std::int64_t limit_bytes, const MemoryNeeds& needs) {
  QMPIPE_CHECK(needs.threads >= 1 && limit_bytes >= 0);
  const std::int64_t fixed = kProgramBytes + kGdalCacheBytes + needs.lattice_bytes +
                             needs.tiles * kPlanBytesPerTile + needs.output_bytes;
  const std::int64_t smallest_cache = kSmallestCacheBytes + needs.source_block_bytes;
  // The cache's bound does not hold for the block that a thread has in hand.
  const std::int64_t bytes_per_sampler =
      kSamplingBytesPerThread + needs.source_block_bytes + needs.source_handle_bytes;

  MemoryPlan plan;
  plan.smallest_limit_bytes =
      fixed + std::max(smallest_cache + bytes_per_sampler, tiles_bytes(needs, 1));
  plan.fits = limit_bytes == 0 || limit_bytes >= plan.smallest_limit_bytes;
  plan.source_cache_bytes =
      std::max({kComfortableCacheBytes, smallest_cache, needs.source_front_bytes});
  plan.sampling_threads = needs.threads;
  plan.max_in_flight = comfortable_in_flight(needs.threads);
  if (limit_bytes > 0) {
    // First the cache down to its least, then the samplers.
    const std::int64_t room_bytes = limit_bytes - fixed;
    plan.source_cache_bytes = std::clamp(room_bytes - plan.sampling_threads * bytes_per_sampler,
                                         smallest_cache, plan.source_cache_bytes);
    plan.sampling_threads = static_cast<std::int32_t>(std::clamp<std::int64_t>(
        (room_bytes - plan.source_cache_bytes) / bytes_per_sampler, 1, plan.sampling_threads));
    plan.max_in_flight = static_cast<std::int32_t>(
        std::clamp<std::int64_t>(tiles_within(needs, room_bytes), 1, plan.max_in_flight));
  }
  // Sampling and meshing follow each other, so each may use what the other has given back.
  plan.expected_peak_bytes =
      fixed + std::max(plan.source_cache_bytes + plan.sampling_threads * bytes_per_sampler,
                       tiles_bytes(needs, plan.max_in_flight));
  return plan;
}

}  // namespace qmpipe
