#include "scheduler/wavefront.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "scheduler/check.h"

namespace qmpipe::wavefront_test {
namespace {

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

std::vector<TileKey> all_keys(const TilingScheme& scheme, std::int32_t zoom) {
  std::vector<TileKey> keys;
  for (std::int32_t y = 0; y < scheme.rows(zoom); ++y) {
    for (std::int32_t x = 0; x < scheme.columns(zoom); ++x) keys.push_back({zoom, x, y});
  }
  return keys;
}

std::vector<TileKey> subset(const std::vector<TileKey>& keys, std::uint64_t bits) {
  std::vector<TileKey> chosen;
  for (std::size_t k = 0; k < keys.size(); ++k) {
    if ((bits >> k & 1U) != 0) chosen.push_back(keys[k]);
  }
  return chosen;
}

std::vector<TileKey> random_subset(std::mt19937_64& random, const std::vector<TileKey>& keys) {
  const std::uint64_t percent = 1 + random() % 100;
  std::vector<TileKey> chosen;
  for (const TileKey& key : keys) {
    if (random() % 100 < percent) chosen.push_back(key);
  }
  return chosen;
}

// What is wrong with one side of the k-th tile; empty when nothing is.
std::string fault_of_side(const TilingScheme& scheme, const std::map<TileKey, TileIndex>& places,
                          const WavefrontPlan& plan, std::size_t k, Side side) {
  const PlannedTile& tile = plan.tiles[k];
  const auto across = scheme.neighbour(tile.key, side);
  const auto found = across ? places.find(*across) : places.end();
  const TileIndex neighbour = tile.neighbours[index_of(side)];
  const SideRole role = tile.roles[index_of(side)];
  if (found == places.end()) {
    return neighbour == kNoTile && role == SideRole::kAlone ? "" : "has a neighbour that is none";
  }
  if (neighbour != found->second) return "has the wrong neighbour";
  if (found->second == static_cast<TileIndex>(k)) return role == SideRole::kSelf ? "" : "not self";
  const PlannedTile& other = plan.tiles[static_cast<std::size_t>(neighbour)];
  if (colour_of(tile.key) == colour_of(other.key)) return "shares a side with its own colour";
  const bool owns = colour_of(tile.key) < colour_of(other.key);
  if (role != (owns ? SideRole::kOwner : SideRole::kHeir)) return "has the wrong role";
  const SideRole back = other.roles[index_of(opposite(side))];
  if (back != (owns ? SideRole::kHeir : SideRole::kOwner)) return "does not complement its heir";
  if (!owns && neighbour >= static_cast<TileIndex>(k)) return "stands before its owner";
  return "";
}

// Everything that a plan promises, by brute force; empty when it holds.
std::string fault_of(const TilingScheme& scheme, const std::vector<TileKey>& keys,
                     const WavefrontPlan& plan) {
  std::map<TileKey, TileIndex> places;
  for (std::size_t k = 0; k < plan.tiles.size(); ++k) {
    places.emplace(plan.tiles[k].key, static_cast<TileIndex>(k));
  }
  if (plan.tiles.size() != keys.size() || places.size() != keys.size()) return "not each key once";
  for (const TileKey& key : keys) {
    if (places.count(key) == 0) return to_string(key) + " is missing";
  }
  std::vector<int> chain(plan.tiles.size(), 0);
  for (std::size_t k = 0; k < plan.tiles.size(); ++k) {
    const PlannedTile& tile = plan.tiles[k];
    if (k > 0 && plan.tiles[k - 1].key.zoom > tile.key.zoom) return "a finer zoom stands before";
    std::int32_t heirs = 0;
    for (const Side side : kSides) {
      const std::string fault = fault_of_side(scheme, places, plan, k, side);
      if (!fault.empty()) return to_string(tile.key) + " " + name_of(side) + ": " + fault;
      if (tile.roles[index_of(side)] != SideRole::kHeir) continue;
      ++heirs;
      const auto owner = static_cast<std::size_t>(tile.neighbours[index_of(side)]);
      chain[k] = std::max(chain[k], chain[owner] + 1);
    }
    if (heirs != tile.in_degree) return to_string(tile.key) + ": wrong in-degree";
    if (chain[k] > 3) return to_string(tile.key) + ": a chain of more than three";
  }
  return "";
}

void expect_all_subsets_right(const TilingScheme& scheme, std::int32_t zoom) {
  const std::vector<TileKey> keys = all_keys(scheme, zoom);
  for (std::uint64_t bits = 0; bits < 1ULL << keys.size(); ++bits) {
    const std::vector<TileKey> chosen = subset(keys, bits);
    ASSERT_EQ(fault_of(scheme, chosen, plan_wavefront(scheme, chosen)), "") << "subset " << bits;
  }
}

TEST(Wavefront, EverySubsetOfASmallZoomHoldsItsPromises) {
  expect_all_subsets_right(kGeodetic, 0);
  expect_all_subsets_right(kGeodetic, 1);
  expect_all_subsets_right(kMercator, 0);
  expect_all_subsets_right(kMercator, 1);
}

TEST(Wavefront, EverySubsetOfSixteenTilesHoldsItsPromises) {
  expect_all_subsets_right(kMercator, 2);
}

TEST(Wavefront, RandomSubsetsOfWholePyramidsHoldTheirPromises) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (std::uint64_t seed = 1; seed <= 150; ++seed) {
      SCOPED_TRACE("seed " + std::to_string(seed));
      std::mt19937_64 random(seed);
      std::vector<TileKey> chosen;
      for (std::int32_t zoom = 0; zoom <= 4; ++zoom) {
        const std::vector<TileKey> some = random_subset(random, all_keys(scheme, zoom));
        chosen.insert(chosen.end(), some.begin(), some.end());
      }
      ASSERT_EQ(fault_of(scheme, chosen, plan_wavefront(scheme, chosen)), "");
    }
  }
}

TEST(Wavefront, AFullZoomHoldsItsPromises) {
  for (const TilingScheme& scheme : {kGeodetic, kMercator}) {
    for (const std::int32_t zoom : {3, 6}) {
      const std::vector<TileKey> keys = all_keys(scheme, zoom);
      EXPECT_EQ(fault_of(scheme, keys, plan_wavefront(scheme, keys)), "");
    }
  }
}

TEST(Wavefront, RowsFollowEachOtherSoThatTheFrontStaysNarrow) {
  const std::vector<TileKey> keys = all_keys(kGeodetic, 3);
  std::vector<std::int32_t> rows;
  for (const PlannedTile& tile : plan_wavefront(kGeodetic, keys).tiles) {
    if (rows.empty() || rows.back() != tile.key.y) rows.push_back(tile.key.y);
  }
  EXPECT_EQ(rows, (std::vector<std::int32_t>{0, 2, 1, 4, 3, 6, 5, 7}));
}

TEST(Wavefront, RolesDependOnKeysAlone) {
  const std::vector<TileKey> keys = all_keys(kGeodetic, 2);
  std::map<TileKey, PlannedTile> full;
  for (const PlannedTile& tile : plan_wavefront(kGeodetic, keys).tiles) full[tile.key] = tile;
  for (std::uint64_t seed = 1; seed <= 200; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    for (const PlannedTile& tile : plan_wavefront(kGeodetic, random_subset(random, keys)).tiles) {
      for (const Side side : kSides) {
        if (tile.roles[index_of(side)] == SideRole::kAlone) continue;
        ASSERT_EQ(tile.roles[index_of(side)], full[tile.key].roles[index_of(side)]);
      }
    }
  }
}

TEST(Wavefront, ZoomZeroWrapsAroundTheGlobe) {
  const WavefrontPlan geodetic = plan_wavefront(kGeodetic, kGeodetic.roots());
  ASSERT_EQ(geodetic.tiles.size(), 2U);
  EXPECT_EQ(geodetic.tiles[0].roles[index_of(Side::kWest)], SideRole::kOwner);
  EXPECT_EQ(geodetic.tiles[0].roles[index_of(Side::kEast)], SideRole::kOwner);
  EXPECT_EQ(geodetic.tiles[1].in_degree, 2);
  const WavefrontPlan mercator = plan_wavefront(kMercator, kMercator.roots());
  ASSERT_EQ(mercator.tiles.size(), 1U);
  EXPECT_EQ(mercator.tiles[0].roles[index_of(Side::kWest)], SideRole::kSelf);
  EXPECT_EQ(mercator.tiles[0].roles[index_of(Side::kNorth)], SideRole::kAlone);
  EXPECT_EQ(mercator.tiles[0].in_degree, 0);
}

TEST(Wavefront, UnsortedOrRepeatedKeysAreABug) {
  const std::vector<TileKey> unsorted = {{1, 1, 0}, {1, 0, 0}};
  const std::vector<TileKey> repeated = {{1, 1, 0}, {1, 1, 0}};
  EXPECT_THROW(plan_wavefront(kGeodetic, unsorted), InternalError);
  EXPECT_THROW(plan_wavefront(kGeodetic, repeated), InternalError);
  EXPECT_TRUE(plan_wavefront(kGeodetic, {}).tiles.empty());
}

}  // namespace
}  // namespace qmpipe::wavefront_test
