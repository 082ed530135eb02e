// What every border store keeps, wherever it keeps it.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <map>
#include <string>
#include <thread>
#include <vector>

#include "tests/support/random_borders.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::border_store_test {
namespace {

using testing::border_of_number;
using testing::kBorderNumbers;
using testing::mask_of_seed;
using testing::open_borders;
using testing::publish;
using testing::take;
using testing::TemporaryFolder;

struct StoreKind {
  std::string name;
  std::function<std::unique_ptr<BorderStore>(const std::filesystem::path&)> make;
};

std::vector<StoreKind> store_kinds() {
  return {{"Memory", [](const auto& /*folder*/) { return make_memory_border_store(); }},
          {"Hdf5", [](const auto& folder) { return open_borders(folder, {.max_zoom = 5}); }},
          {"Hdf5WithoutCache", [](const auto& folder) {
             return open_borders(folder, {.max_zoom = 5, .cache_bytes = 0});
           }}};
}

class AnyBorderStore : public ::testing::TestWithParam<StoreKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, AnyBorderStore, ::testing::ValuesIn(store_kinds()),
                         [](const auto& kind) { return kind.param.name; });

TEST_P(AnyBorderStore, GivesOutWhatWasPublishedWheneverItWasSealed) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const TemporaryFolder folder;
    const auto store = GetParam().make(folder.path());
    std::map<std::int32_t, BorderMask> waiting;
    std::vector<bool> is_published(kBorderNumbers);
    const std::uint64_t one_seal_in = seed == 1 ? 1000 : 300;
    for (int step = 0; step < 2500; ++step) {
      const auto n = static_cast<std::int32_t>(random() % kBorderNumbers);
      if (!is_published[static_cast<std::size_t>(n)]) {
        is_published[static_cast<std::size_t>(n)] = true;
        publish(*store, n, waiting[n] = mask_of_seed(random()));
      }
      if (random() % one_seal_in == 0) store->seal();
      if (random() % 3 == 0) {
        const auto it = waiting.lower_bound(static_cast<std::int32_t>(random() % kBorderNumbers));
        if (it == waiting.end()) continue;
        ASSERT_EQ(take(*store, it->first), it->second) << to_string(border_of_number(it->first));
        waiting.erase(it);
      }
      ASSERT_EQ(store->size(), std::ssize(waiting));
    }
    store->seal();
    for (const auto& [n, mask] : waiting) {
      ASSERT_EQ(take(*store, n), mask) << to_string(border_of_number(n));
    }
    EXPECT_EQ(store->size(), 0);
  }
}

TEST_P(AnyBorderStore, KeepsEveryPositionOfAMask) {
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path());
  for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
    BorderMask mask;
    mask.set(k);
    publish(*store, k, mask);
  }
  store->seal();
  for (std::int32_t k = 0; k <= kTileIntervals; ++k) {
    const BorderMask mask = take(*store, k);
    ASSERT_EQ(mask.count(), 1) << k;
    ASSERT_TRUE(mask.test(k)) << k;
  }
}

TEST_P(AnyBorderStore, TellsABorderThatNobodyPublishedFromABug) {
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path());
  EXPECT_THROW(take(*store, 7), InternalError);
  publish(*store, 6, mask_of_seed(1));
  publish(*store, 8, mask_of_seed(2));
  EXPECT_THROW(publish(*store, 6, mask_of_seed(1)), InternalError);
  EXPECT_THROW(take(*store, 7), InternalError);
  take(*store, 6);
  EXPECT_THROW(take(*store, 6), InternalError);
  store->seal();
  EXPECT_THROW(take(*store, 7), InternalError);
  EXPECT_EQ(take(*store, 8), mask_of_seed(2));
}

TEST_P(AnyBorderStore, ThreadsPublishAndTakeWhileAnotherSeals) {
  constexpr std::int32_t kThreads = 4;
  constexpr std::int32_t kEach = kBorderNumbers / kThreads;
  constexpr std::int32_t kLate = 900;
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path());
  std::atomic<int> wrong = 0;
  std::atomic<int> busy = kThreads;
  std::vector<std::thread> threads;
  for (std::int32_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      const auto number = [t](std::int32_t k) { return k * kThreads + t; };
      const auto check = [&](std::int32_t n) {
        if (take(*store, n) != mask_of_seed(static_cast<std::uint64_t>(n))) ++wrong;
      };
      // Each border is taken right away, or long after.
      for (std::int32_t k = 0; k < kEach; ++k) {
        const std::int32_t n = number(k);
        publish(*store, n, mask_of_seed(static_cast<std::uint64_t>(n)));
        if (k % 3 == 0) check(n);
        if (k >= kLate && (k - kLate) % 3 != 0) check(number(k - kLate));
        if (store->size() < 0 || store->memory_bytes() < 0) ++wrong;
      }
      for (std::int32_t k = kEach - kLate; k < kEach; ++k) {
        if (k % 3 != 0) check(number(k));
      }
      --busy;
    });
  }
  while (busy > 0) store->seal();
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  EXPECT_EQ(store->size(), 0);
}

}  // namespace
}  // namespace qmpipe::border_store_test
