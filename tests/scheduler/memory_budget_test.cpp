#include "scheduler/memory_budget.h"

#include <gtest/gtest.h>

#include <random>

namespace qmpipe::memory_budget_test {
namespace {

constexpr std::int64_t kMiB = 1 << 20;
constexpr std::int64_t kGiB = 1 << 30;

MemoryNeeds random_needs(std::mt19937_64& random) {
  const auto below = [&random](std::int64_t end) {
    return static_cast<std::int64_t>(random() % static_cast<std::uint64_t>(end));
  };
  return {.threads = static_cast<std::int32_t>(1 + below(100)),
          .lattice_bytes = below(4 * kGiB),
          .source_block_bytes = below(2) == 0 ? below(100 * kMiB) : 0,
          .source_front_bytes = below(kGiB),
          .source_handle_bytes = below(kMiB),
          .simplify_bytes = below(2) == 0 ? below(60 * kMiB) : 0,
          .tiles = below(1'000'000),
          .output_bytes = below(2) == 0 ? below(100 * kMiB) : 0};
}

TEST(MemoryBudget, WhatFitsStaysBelowItsLimit) {
  for (std::uint64_t seed = 1; seed <= 5000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const MemoryNeeds needs = random_needs(random);
    const auto limit_bytes = static_cast<std::int64_t>(1 + random() % (8ULL << 30U));
    const MemoryPlan plan = plan_memory(limit_bytes, needs);
    ASSERT_EQ(plan.fits, limit_bytes >= plan.smallest_limit_bytes);
    if (!plan.fits) continue;
    ASSERT_LE(plan.expected_peak_bytes, limit_bytes);
    ASSERT_GE(plan.max_in_flight, 1);
    ASSERT_GE(plan.sampling_threads, 1);
    ASSERT_LE(plan.sampling_threads, needs.threads);
    ASSERT_GE(plan.source_cache_bytes, needs.source_block_bytes);
    // The peak is the sum of its parts, not a number of its own.
    const std::int64_t fixed = kProgramBytes + kGdalCacheBytes + needs.lattice_bytes;
    ASSERT_GE(plan.expected_peak_bytes,
              fixed + plan.max_in_flight * kTileInFlightBytes +
                  std::min(plan.max_in_flight, needs.threads) * needs.simplify_bytes);
    ASSERT_GE(plan.expected_peak_bytes,
              fixed + plan.source_cache_bytes + plan.sampling_threads * kSamplingBytesPerThread);
  }
}

TEST(MemoryBudget, ARefusalNamesTheSmallestLimitThatWorks) {
  for (std::uint64_t seed = 1; seed <= 1000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const MemoryNeeds needs = random_needs(random);
    const MemoryPlan refused = plan_memory(1, needs);
    ASSERT_FALSE(refused.fits);
    ASSERT_GT(refused.smallest_limit_bytes, 0);
    ASSERT_TRUE(plan_memory(refused.smallest_limit_bytes, needs).fits);
    ASSERT_LE(plan_memory(refused.smallest_limit_bytes, needs).expected_peak_bytes,
              refused.smallest_limit_bytes);
    ASSERT_FALSE(plan_memory(refused.smallest_limit_bytes - 1, needs).fits);
  }
}

TEST(MemoryBudget, MoreMemoryNeverGivesLess) {
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const MemoryNeeds needs = random_needs(random);
    const MemoryPlan comfortable = plan_memory(0, needs);
    MemoryPlan before = plan_memory(comfortable.smallest_limit_bytes, needs);
    for (std::int64_t limit = comfortable.smallest_limit_bytes; limit < 8 * kGiB;
         limit += 17 * kMiB) {
      const MemoryPlan plan = plan_memory(limit, needs);
      ASSERT_TRUE(plan.fits);
      ASSERT_GE(plan.max_in_flight, before.max_in_flight);
      ASSERT_GE(plan.sampling_threads, before.sampling_threads);
      ASSERT_GE(plan.source_cache_bytes, before.source_cache_bytes);
      ASSERT_LE(plan.max_in_flight, comfortable.max_in_flight);
      ASSERT_LE(plan.source_cache_bytes, comfortable.source_cache_bytes);
      before = plan;
    }
  }
}

TEST(MemoryBudget, NoLimitGivesEveryThreadWork) {
  for (const std::int32_t threads : {1, 2, 8, 80, 256}) {
    const MemoryPlan plan = plan_memory(0, {.threads = threads});
    EXPECT_TRUE(plan.fits);
    EXPECT_EQ(plan.sampling_threads, threads);
    EXPECT_GE(plan.max_in_flight, 2 * threads);
    // The plan it announces works as a limit.
    const MemoryPlan again = plan_memory(plan.expected_peak_bytes, {.threads = threads});
    EXPECT_EQ(again.max_in_flight, plan.max_in_flight);
    EXPECT_EQ(again.expected_peak_bytes, plan.expected_peak_bytes);
  }
}

TEST(MemoryBudget, EightyThreadsWorkWithinASmallLimit) {
  const MemoryNeeds needs = {.threads = 80, .lattice_bytes = 100 * kMiB, .tiles = 257'000};
  const MemoryPlan refused = plan_memory(128 * kMiB, needs);
  EXPECT_FALSE(refused.fits);
  for (const std::int64_t limit : {320 * kMiB, 512 * kMiB, kGiB, 2 * kGiB}) {
    const MemoryPlan plan = plan_memory(limit, needs);
    EXPECT_TRUE(plan.fits) << limit;
    EXPECT_LE(plan.expected_peak_bytes, limit);
    EXPECT_GE(plan.max_in_flight, 1);
  }
  EXPECT_LT(plan_memory(320 * kMiB, needs).sampling_threads, 80);
}

TEST(MemoryBudget, ALargeSourceBlockRaisesTheSmallestLimit) {
  const MemoryPlan small = plan_memory(0, {.threads = 2});
  const MemoryPlan large = plan_memory(0, {.threads = 2, .source_block_bytes = 200 * kMiB});
  EXPECT_GE(large.smallest_limit_bytes - small.smallest_limit_bytes, 200 * kMiB);
  EXPECT_GE(large.source_cache_bytes, 200 * kMiB);
}

TEST(MemoryBudget, TheCacheGrowsToWhatTheSurveyUses) {
  const MemoryNeeds small_front = {.threads = 2, .source_front_bytes = kMiB};
  const MemoryNeeds large_front = {.threads = 2, .source_front_bytes = 400 * kMiB};
  EXPECT_EQ(plan_memory(0, large_front).source_cache_bytes, 400 * kMiB);
  EXPECT_LT(plan_memory(0, small_front).source_cache_bytes, 100 * kMiB);
  EXPECT_EQ(plan_memory(2 * kGiB, large_front).source_cache_bytes, 400 * kMiB);
  const MemoryPlan tight = plan_memory(256 * kMiB, large_front);
  EXPECT_TRUE(tight.fits);
  EXPECT_LT(tight.source_cache_bytes, 256 * kMiB);
  EXPECT_EQ(tight.max_in_flight, plan_memory(2 * kGiB, large_front).max_in_flight);
}

TEST(MemoryBudget, HandlesOfEveryThreadCount) {
  const MemoryPlan none = plan_memory(0, {.threads = 8});
  const MemoryPlan some = plan_memory(0, {.threads = 8, .source_handle_bytes = 50 * kMiB});
  EXPECT_GE(some.smallest_limit_bytes - none.smallest_limit_bytes, 50 * kMiB);
  EXPECT_GE(some.expected_peak_bytes,
            kProgramBytes + some.source_cache_bytes + 8 * (kSamplingBytesPerThread + 50 * kMiB));
}

}  // namespace
}  // namespace qmpipe::memory_budget_test
