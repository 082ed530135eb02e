// What every lattice store keeps, wherever it keeps it.
#include <gtest/gtest.h>

#include <atomic>
#include <functional>
#include <string>
#include <thread>

#include "formats/bytes/recent_cache.h"
#include "formats/run_store/block_codec.h"
#include "formats/run_store/hdf5_lattice_store.h"
#include "formats/run_store/tiered_lattice_store.h"
#include "tests/support/lattice_blocks.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::lattice_store_test {
namespace {

using testing::block_of_seed;
using testing::BlockModel;
using testing::same_height;
using testing::TemporaryFolder;

const TilingScheme kGeodetic{Projection::kGeodetic};
const TilingScheme kMercator{Projection::kMercator};
const std::vector<float> kVoidBlock(kBlockSize, testing::kVoidHeight);

std::unique_ptr<LatticeStore> small_hdf5_store(const std::filesystem::path& folder,
                                               const TilingScheme& scheme, std::int32_t max_zoom) {
  // Small, so that segments are written and blocks leave the cache in the middle of a test.
  auto store = open_hdf5_lattice_store(
      folder, scheme, {.max_zoom = max_zoom, .segment_bytes = 300'000, .cache_bytes = 1 << 20});
  if (!store) throw std::runtime_error(store.error().message);
  return std::move(*store);
}

struct StoreKind {
  std::string name;
  std::function<std::unique_ptr<LatticeStore>(const std::filesystem::path&, const TilingScheme&,
                                              std::int32_t)>
      make;
};

std::vector<StoreKind> store_kinds() {
  return {
      {"Memory", [](const std::filesystem::path& /*folder*/, const TilingScheme& scheme,
                    std::int32_t max_zoom) { return make_memory_lattice_store(scheme, max_zoom); }},
      {"Hdf5", small_hdf5_store},
      {"Tiered",
       [](const std::filesystem::path& folder, const TilingScheme& scheme, std::int32_t max_zoom) {
         return make_tiered_lattice_store(make_memory_lattice_store(scheme, 1), 1,
                                          small_hdf5_store(folder, scheme, max_zoom));
       }}};
}

class AnyLatticeStore : public ::testing::TestWithParam<StoreKind> {};
INSTANTIATE_TEST_SUITE_P(Kinds, AnyLatticeStore, ::testing::ValuesIn(store_kinds()),
                         [](const auto& kind) { return kind.param.name; });

std::int32_t below(std::mt19937_64& random, std::int32_t end) {
  return static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(end));
}

TileKey random_block(std::mt19937_64& random, const TilingScheme& scheme, std::int32_t max_zoom) {
  const std::int32_t zoom = below(random, max_zoom + 1);
  return {.zoom = zoom,
          .x = below(random, scheme.columns(zoom)),
          .y = below(random, scheme.rows(zoom) + 1)};
}

void put(LatticeStore& store, BlockModel& model, const TileKey& key,
         const std::vector<float>& heights_m) {
  store.put_block(key, heights_m);
  model.put(key, heights_m);
}

TEST_P(AnyLatticeStore, ReadsWhatWasPutLastAroundTheGlobe) {
  constexpr std::int32_t kDeepest = 2;
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::uint64_t seed = 1; seed <= 2; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      const TemporaryFolder folder;
      const auto store = GetParam().make(folder.path(), scheme, kDeepest);
      BlockModel model;
      for (int step = 0; step < 50; ++step) {
        const TileKey key = random_block(random, scheme, kDeepest);
        put(*store, model, key, random() % 4 == 0 ? kVoidBlock : block_of_seed(random()));
        if (random() % 16 == 0) store->seal();
        if (step % 4 != 0) continue;
        const Lattice lattice(scheme, below(random, kDeepest + 1));
        const PostWindow window = {below(random, 5000) - 2500, below(random, 1500) - 300,
                                   1 + below(random, 600), 1 + below(random, 600)};
        ASSERT_EQ(model.differences(*store, lattice, window), 0U);
      }
      ASSERT_EQ(model.differences(*store, scheme), 0U);
    }
  }
}

TEST_P(AnyLatticeStore, AnAllVoidBlockHidesAnOlderOneBeforeAndAfterSealing) {
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path(), kGeodetic, 3);
  BlockModel model;
  for (const std::int32_t zoom : {0, 3}) {
    put(*store, model, {.zoom = zoom, .x = 0, .y = 0}, block_of_seed(1));
    put(*store, model, {.zoom = zoom, .x = 1, .y = 0}, block_of_seed(2));
    put(*store, model, {.zoom = zoom, .x = 0, .y = 0}, kVoidBlock);
    ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
    store->seal();
    ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
    put(*store, model, {.zoom = zoom, .x = 1, .y = 0}, kVoidBlock);
    ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
    store->seal();
    ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
    put(*store, model, {.zoom = zoom, .x = 1, .y = 0}, block_of_seed(4));
    ASSERT_EQ(model.differences(*store, kGeodetic), 0U);
  }
}

TEST_P(AnyLatticeStore, BlocksThatWereNeverPutTakeNoRoom) {
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path(), kMercator, 2);
  store->put_block({.zoom = 2, .x = 3, .y = 4}, kVoidBlock);
  store->seal();
  EXPECT_FALSE(store->has_block({.zoom = 2, .x = 3, .y = 4}));
  EXPECT_EQ(store->memory_bytes(), 0);
}

TEST_P(AnyLatticeStore, KeepsEveryBitOfAHeight) {
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path(), kGeodetic, 2);
  std::vector<float> block(kBlockSize);
  std::mt19937_64 random(5);
  for (float& height_m : block) {
    do {
      height_m = std::bit_cast<float>(static_cast<std::uint32_t>(random()));
    } while (std::isnan(height_m));
  }
  block[0] = -0.0F;
  block[1] = std::numeric_limits<float>::infinity();
  block[2] = std::numeric_limits<float>::denorm_min();
  BlockModel model;
  put(*store, model, {.zoom = 2, .x = 7, .y = 3}, block);
  EXPECT_EQ(model.differences(*store, kGeodetic), 0U);
  store->seal();
  EXPECT_EQ(model.differences(*store, kGeodetic), 0U);
}

TEST_P(AnyLatticeStore, EightThreadsPutAndReadTheirOwnBlocks) {
  constexpr std::int32_t kZoom = 5;
  constexpr std::int32_t kThreads = 8;
  constexpr std::int32_t kBlocksEach = 16;
  const TemporaryFolder folder;
  const auto store = GetParam().make(folder.path(), kGeodetic, kZoom);
  const auto key_of = [](std::int32_t n) {
    return TileKey{.zoom = kZoom, .x = n % 64, .y = n / 64};
  };
  const auto is_right = [&](std::int32_t n) {
    const std::vector<float> expected = block_of_seed(static_cast<std::uint64_t>(n));
    std::vector<float> out(kBlockSize);
    store->read(Lattice(kGeodetic, kZoom), posts_of(key_of(n)), out);
    return std::equal(out.begin(), out.end(), expected.begin(), same_height);
  };
  std::atomic<int> wrong = 0;
  std::vector<std::thread> threads;
  for (std::int32_t t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (std::int32_t k = 0; k < kBlocksEach; ++k) {
        const std::int32_t n = k * kThreads + t;
        const TileKey key = key_of(n);
        store->put_block(key, block_of_seed(static_cast<std::uint64_t>(n)));
        const std::int32_t earlier = (k / 2) * kThreads + t;
        if (!is_right(n) || !is_right(earlier) || store->memory_bytes() <= 0) ++wrong;
        if (k == kBlocksEach / 2) store->seal();
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(wrong, 0);
  for (std::int32_t n = 0; n < kThreads * kBlocksEach; ++n) ASSERT_TRUE(is_right(n)) << n;
}

TEST(RecentCache, LetsGoOfWhatWasAskedForLongestAgo) {
  RecentCache<int> cache(3 * 100 + 5, 100);
  const auto value = std::make_shared<const int>(7);
  for (const std::uint64_t name : {1U, 2U, 3U}) cache.add(name, value);
  EXPECT_NE(cache.find(1), nullptr);
  cache.add(4, value);
  EXPECT_EQ(cache.find(2), nullptr);
  EXPECT_NE(cache.find(1), nullptr);
  EXPECT_NE(cache.find(3), nullptr);
  EXPECT_NE(cache.find(4), nullptr);
  EXPECT_EQ(cache.memory_bytes(), 300);
}

TEST(RecentCache, KeepsNothingWithoutRoomForAValue) {
  RecentCache<int> cache(99, 100);
  cache.add(1, std::make_shared<const int>(7));
  EXPECT_EQ(cache.find(1), nullptr);
  EXPECT_EQ(cache.memory_bytes(), 0);
}

TEST(BlockCodec, RefusesEveryTruncationOfAChunk) {
  const BlockCodec codec(1);
  const std::vector<std::uint8_t> chunk = codec.compress(block_of_seed(1));
  ASSERT_TRUE(codec.decompress(chunk).ok());
  for (std::size_t bytes = 0; bytes < chunk.size(); ++bytes) {
    ASSERT_FALSE(codec.decompress(std::span(chunk).first(bytes)).ok()) << bytes;
  }
}

}  // namespace
}  // namespace qmpipe::lattice_store_test
