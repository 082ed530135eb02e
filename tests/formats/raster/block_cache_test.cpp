#include "formats/raster/block_cache.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <random>
#include <stdexcept>
#include <thread>

namespace qmpipe::block_cache_test {
namespace {

using Request = SourceBlockCache::Request;

constexpr std::int64_t kBlockBytes = 1000;

// What block `index` of `source` holds in every byte.
std::uint8_t value_of(const Request& request) {
  return static_cast<std::uint8_t>(request.index * 7 + request.source * 31 + 1);
}

void fill(const Request& request, std::span<std::uint8_t> bytes) {
  std::fill(bytes.begin(), bytes.end(), value_of(request));
}

std::shared_ptr<const SourceBlockCache::Bytes> get(SourceBlockCache& cache,
                                                   const Request& request) {
  return cache.get(request, [&](std::span<std::uint8_t> bytes) { fill(request, bytes); });
}

Request block(std::int64_t index, std::uint32_t source = 0) {
  return {.source = source, .index = index, .size_bytes = kBlockBytes};
}

void on_threads(int count, const std::function<void(int)>& body) {
  std::vector<std::thread> threads;
  for (int t = 0; t < count; ++t) threads.emplace_back([&body, t] { body(t); });
  for (std::thread& thread : threads) thread.join();
}

TEST(SourceBlockCache, AnswersFromMemoryWhatItHasDecoded) {
  SourceBlockCache cache(10 * kBlockBytes);
  for (int round = 0; round < 3; ++round) {
    for (std::int64_t k = 0; k < 10; ++k) {
      const auto bytes = get(cache, block(k));
      ASSERT_EQ(bytes->size(), static_cast<std::size_t>(kBlockBytes));
      EXPECT_EQ(bytes->front(), value_of(block(k)));
    }
  }
  EXPECT_EQ(cache.reads().blocks, 10);
  EXPECT_EQ(cache.reads().decoded_blocks, 10);
  EXPECT_EQ(cache.reads().decoded_bytes, 10 * kBlockBytes);
  EXPECT_EQ(cache.memory_bytes(), 10 * kBlockBytes);
}

TEST(SourceBlockCache, SourcesAndBlocksAreNotConfused) {
  SourceBlockCache cache(1000 * kBlockBytes);
  for (std::uint32_t source = 0; source < 20; ++source) {
    for (std::int64_t k = 0; k < 20; ++k) {
      EXPECT_EQ(get(cache, block(k, source))->back(), value_of(block(k, source)));
    }
  }
  EXPECT_EQ(cache.reads().blocks, 400);
  EXPECT_EQ(cache.reads().decoded_per_block(), 1);
}

TEST(SourceBlockCache, LetsGoOfWhatWasAskedForLongestAgo) {
  SourceBlockCache cache(3 * kBlockBytes);
  for (const std::int64_t k : {0, 1, 2, 0, 3}) get(cache, block(k));
  const std::int64_t before = cache.reads().decoded_blocks;
  for (const std::int64_t k : {0, 2, 3}) get(cache, block(k));
  EXPECT_EQ(cache.reads().decoded_blocks, before);
  get(cache, block(1));
  EXPECT_EQ(cache.reads().decoded_blocks, before + 1);
  EXPECT_EQ(cache.reads().blocks, 4);
}

TEST(SourceBlockCache, AnyBoundHoldsAndIsCountedHonestly) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const std::int64_t bound_bytes = static_cast<std::int64_t>(random() % 20) * kBlockBytes / 2;
    SourceBlockCache cache(bound_bytes);
    std::int64_t decoded = 0;
    std::vector<bool> seen(50);
    for (int step = 0; step < 2000; ++step) {
      Request request = block(static_cast<std::int64_t>(random() % seen.size()));
      request.file_blocks = 3;
      const auto bytes = cache.get(request, [&](std::span<std::uint8_t> into) {
        fill(request, into);
        ++decoded;
      });
      ASSERT_EQ(bytes->front(), value_of(request));
      seen[static_cast<std::size_t>(request.index)] = true;
      ASSERT_LE(cache.memory_bytes(), std::max(bound_bytes, kBlockBytes));
    }
    EXPECT_EQ(cache.reads().decoded_blocks, 3 * decoded);
    EXPECT_EQ(cache.reads().blocks, 3 * std::count(seen.begin(), seen.end(), true));
  }
}

TEST(SourceBlockCache, WhatWasHandedOutStays) {
  SourceBlockCache cache(0);
  const auto first = get(cache, block(1));
  for (std::int64_t k = 2; k < 100; ++k) get(cache, block(k));
  EXPECT_EQ(first->back(), value_of(block(1)));
  // In a reader's hand it takes memory anyway.
  const std::int64_t before = cache.reads().decoded_blocks;
  get(cache, block(1));
  EXPECT_EQ(cache.reads().decoded_blocks, before);
}

TEST(SourceBlockCache, ThreadsWaitForOneThatDecodes) {
  SourceBlockCache cache(1000 * kBlockBytes);
  std::array<std::atomic<int>, 40> decodes{};
  on_threads(8, [&](int) {
    for (std::int64_t k = 0; k < 40; ++k) {
      const auto bytes = cache.get(block(k), [&](std::span<std::uint8_t> into) {
        ++decodes[static_cast<std::size_t>(k)];
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
        fill(block(k), into);
      });
      EXPECT_EQ(bytes->back(), value_of(block(k)));
    }
  });
  for (const auto& count : decodes) EXPECT_EQ(count, 1);
  EXPECT_EQ(cache.reads().decoded_blocks, 40);
}

TEST(SourceBlockCache, ThreadsWithinATinyBoundGetTheRightBytes) {
  constexpr int kThreads = 8;
  SourceBlockCache cache(3 * kBlockBytes);
  on_threads(kThreads, [&](int t) {
    std::mt19937_64 random(static_cast<std::uint64_t>(t));
    for (int step = 0; step < 3000; ++step) {
      const Request request = block(static_cast<std::int64_t>(random() % 12), random() % 2 == 0);
      const auto bytes = get(cache, request);
      const std::uint8_t value = value_of(request);
      EXPECT_TRUE(
          std::all_of(bytes->begin(), bytes->end(), [value](auto b) { return b == value; }));
      EXPECT_LE(cache.memory_bytes(), (3 + kThreads) * kBlockBytes);
    }
  });
  EXPECT_EQ(cache.reads().blocks, 24);
  EXPECT_GT(cache.reads().decoded_blocks, 24);
}

TEST(SourceBlockCache, AFailureReachesEveryThreadAndIsForgotten) {
  SourceBlockCache cache(10 * kBlockBytes);
  std::atomic<int> refused = 0;
  on_threads(8, [&](int) {
    for (std::int64_t k = 0; k < 20; ++k) {
      try {
        cache.get(block(k), [&](std::span<std::uint8_t>) {
          std::this_thread::sleep_for(std::chrono::milliseconds(1));
          throw std::runtime_error("block " + std::to_string(k));
        });
      } catch (const std::runtime_error& error) {
        EXPECT_EQ(error.what(), "block " + std::to_string(k));
        ++refused;
      }
    }
  });
  EXPECT_EQ(refused, 8 * 20);
  EXPECT_EQ(cache.memory_bytes(), 0);
  EXPECT_EQ(cache.reads().blocks, 0);
  EXPECT_EQ(cache.reads().decoded_per_block(), 0);
  EXPECT_EQ(get(cache, block(3))->front(), value_of(block(3)));
}

}  // namespace
}  // namespace qmpipe::block_cache_test
