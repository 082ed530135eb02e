// The height range of a set, from a few of its tiles.
#include "pipeline/verify/height_glance.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "scheduler/tiling_scheme.h"
#include "tests/support/random_mesh.h"

namespace qmpipe::testing::height_glance_test {
namespace {

// A whole pyramid of flat tiles, whose headers say the heights of hills under one summit and one pit. As
// in a real one, coarse tiles round them off.
class HillySet final : public TileSet {
 public:
  HillySet(std::int32_t deepest, std::uint32_t seed) : deepest_(deepest), seed_(seed) {
    const TilingScheme scheme(Projection::kGeodetic);
    for (std::int32_t zoom = 0; zoom <= deepest; ++zoom) {
      for (std::int32_t y = 0; y < scheme.rows(zoom); ++y) {
        for (std::int32_t x = 0; x < scheme.columns(zoom); ++x) {
          keys_.push_back({.zoom = zoom, .x = x, .y = y});
        }
      }
    }
    std::mt19937 dice(seed);
    summit_ = keys_[keys_.size() - 1 - dice() % (keys_.size() / 2)];
    pit_ = keys_[keys_.size() - 1 - dice() % (keys_.size() / 2)];
  }

  // What the tiles of the deepest zoom say.
  HeightSpan truth() const {
    HeightSpan all = heights_of(keys_.back());
    for (const TileKey& key : keys_) {
      if (key.zoom == deepest_) all.include(heights_of(key));
    }
    return all;
  }
  int read_count() const { return reads_; }
  void lose(const TileKey& key) { std::erase(keys_, key); }

  Result<std::string> layer_text() const override { return Error{"it has none"}; }
  const std::vector<TileKey>& keys() const override { return keys_; }
  const std::vector<std::string>& strays() const override { return strays_; }
  Result<std::vector<std::uint8_t>> read(const TileKey& key) const override {
    ++reads_;
    const HeightSpan heights = heights_of(key);
    QuantizedMesh mesh = grid_mesh(2);
    mesh.header.min_height_m = static_cast<float>(heights.low_m);
    mesh.header.max_height_m = static_cast<float>(heights.high_m);
    return encode(mesh);
  }
  Result<std::int64_t> stored_bytes(const TileKey&) const override { return std::int64_t{0}; }

 private:
  bool is_above(TileKey key, TileKey place) const {
    while (place.zoom > key.zoom) place = parent_of(place);
    return place == key;
  }
  HeightSpan heights_of(const TileKey& key) const {
    std::mt19937 dice(seed_ ^ static_cast<std::uint32_t>(packed(key) * 2654435761U >> 16U));
    const double rounding = std::max(0.4, 1 - 0.1 * (deepest_ - key.zoom));
    HeightSpan heights = {.low_m = static_cast<double>(dice() % 100), .high_m = 0};
    heights.high_m = heights.low_m + 100 + static_cast<double>(dice() % 200);
    if (is_above(key, summit_)) heights.high_m = 4000 * rounding;
    if (is_above(key, pit_)) heights.low_m = -3000 * rounding;
    return heights;
  }

  std::int32_t deepest_;
  std::uint32_t seed_;
  TileKey summit_;
  TileKey pit_;
  std::vector<TileKey> keys_;
  std::vector<std::string> strays_;
  mutable int reads_ = 0;
};

TEST(HeightGlance, FindsTheSummitAndThePitOfASetOfAnySize) {
  const std::uint32_t seed = std::random_device{}();
  SCOPED_TRACE("seed " + std::to_string(seed));
  for (const std::int32_t deepest : {0, 1, 3, 5, 7}) {
    const HillySet set(deepest, seed);
    const auto found = verify::glance_at_heights(set);
    ASSERT_TRUE(found);
    EXPECT_EQ(*found, set.truth()) << deepest;
    EXPECT_LE(set.read_count(), 128 + 4 * 16 * deepest);
  }
}

TEST(HeightGlance, CoarseTilesCountWhereNothingIsFiner) {
  HillySet set(1, 7);
  const std::vector<TileKey> all = set.keys();
  for (const TileKey& key : all) {
    if (key.zoom == 1) set.lose(key);
  }
  ASSERT_TRUE(verify::glance_at_heights(set));
  EXPECT_LT(verify::glance_at_heights(set)->high_m, 4000);
}

TEST(HeightGlance, ASetWithoutTilesHasNone) {
  HillySet set(0, 1);
  const std::vector<TileKey> all = set.keys();
  for (const TileKey& key : all) set.lose(key);
  EXPECT_FALSE(verify::glance_at_heights(set));
}

}  // namespace
}  // namespace qmpipe::testing::height_glance_test
