#include "formats/pmtiles/pmtiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "formats/bytes/errors.h"
#include "formats/bytes/gzip.h"
#include "formats/pmtiles/directory.h"
#include "formats/pmtiles/id.h"
#include "formats/tile/layer_json.h"
#include "formats/tile_sets/open_tile_set.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::pmtiles_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;
using Tiles = std::map<TileKey, Bytes>;
namespace fs = std::filesystem;

template <class Action>
std::string io_error_of(const Action& action) {
  try {
    action();
  } catch (const IoError& error) {
    return error.what();
  }
  return "no IoError";
}

std::vector<TileKey> every_key(Projection projection, std::int32_t deepest) {
  const TilingScheme scheme(projection);
  std::vector<TileKey> keys;
  for (std::int32_t zoom = 0; zoom <= deepest; ++zoom) {
    for (std::int32_t y = 0; y < scheme.rows(zoom); ++y) {
      for (std::int32_t x = 0; x < scheme.columns(zoom); ++x) keys.push_back({zoom, x, y});
    }
  }
  return keys;
}

std::string layer_text_of(Projection projection) {
  LayerJson layer;
  layer.name = "trial \"of\" names";
  layer.projection = projection;
  layer.bounds_deg = {.west_deg = -10, .south_deg = 40.5, .east_deg = 20, .north_deg = 60};
  return write_layer_json(layer);
}

void pack(const fs::path& path, const Tiles& tiles, Projection projection) {
  std::vector<TileKey> keys;
  for (const auto& [key, bytes] : tiles) keys.push_back(key);
  sort_for_pmtiles(keys, projection);
  const auto sink = open_pmtiles_sink(path, Overwrite::kYes, projection);
  for (const TileKey& key : keys) sink->write(key, tiles.at(key));
  sink->close(layer_text_of(projection));
}

PmtilesIndex index_of(const std::string& file) {
  auto index = read_pmtiles_index(
      [&file](std::uint64_t offset, std::uint64_t bytes) -> Result<Bytes> {
        const std::string part = file.substr(offset, bytes);
        return Bytes(part.begin(), part.end());
      },
      file.size());
  EXPECT_TRUE(index.ok()) << (index.ok() ? "" : index.error().message);
  return std::move(*index);
}

TEST(PmtilesId, CountsAlongTheCurveAsTheReferenceReaderDoes) {
  const auto id = [](std::int32_t zoom, std::uint32_t x, std::uint32_t y) {
    return archive_id({.zoom = zoom, .x = x, .y = y});
  };
  EXPECT_EQ(id(0, 0, 0), 0U);
  EXPECT_EQ(id(1, 0, 0), 1U);
  EXPECT_EQ(id(1, 0, 1), 2U);
  EXPECT_EQ(id(1, 1, 1), 3U);
  EXPECT_EQ(id(1, 1, 0), 4U);
  EXPECT_EQ(id(2, 0, 0), 5U);
  EXPECT_EQ(id(2, 1, 0), 6U);
  // From zxyToTileId() of the npm package pmtiles 4.5.0.
  EXPECT_EQ(id(3, 5, 2), 76U);
  EXPECT_EQ(id(12, 3423, 1763), 19078479U);
  EXPECT_EQ(id(22, 4194303, 0), 23456248059220U);
}

TEST(PmtilesId, NumbersEachPositionOnceAndFindsItAgain) {
  std::uint64_t next = 0;
  for (std::int32_t zoom = 0; zoom <= 7; ++zoom) {
    std::set<std::uint64_t> ids;
    for (std::uint32_t y = 0; y < 1U << static_cast<unsigned>(zoom); ++y) {
      for (std::uint32_t x = 0; x < 1U << static_cast<unsigned>(zoom); ++x) {
        const ArchivePosition at = {.zoom = zoom, .x = x, .y = y};
        ids.insert(archive_id(at));
        ASSERT_EQ(archive_position(archive_id(at)), at);
      }
    }
    ASSERT_EQ(*ids.begin(), next);
    next += ids.size();
    ASSERT_EQ(*ids.rbegin(), next - 1);
  }
  const ArchivePosition last = {.zoom = kDeepestArchiveZoom, .x = (1U << 30U) - 1, .y = 0};
  EXPECT_EQ(archive_position(archive_id(last)), last);
  EXPECT_EQ(archive_position(archive_id(last) + 1), std::nullopt);
}

TEST(PmtilesId, NeighboursOnTheCurveAreNeighboursOnTheGround) {
  for (std::uint64_t id = first_archive_id(6); id + 1 < first_archive_id(7); ++id) {
    const ArchivePosition a = *archive_position(id);
    const ArchivePosition b = *archive_position(id + 1);
    const int dx = std::abs(static_cast<int>(a.x) - static_cast<int>(b.x));
    const int dy = std::abs(static_cast<int>(a.y) - static_cast<int>(b.y));
    ASSERT_EQ(dx + dy, 1);
  }
}

TEST(PmtilesId, NoTwoTilesOfASchemeShareOneAndParentsStandAboveTheirChildren) {
  for (const Projection projection : {Projection::kGeodetic, Projection::kMercator}) {
    std::set<std::uint64_t> ids;
    const std::vector<TileKey> keys = every_key(projection, 6);
    for (const TileKey& key : keys) {
      const std::uint64_t id = pmtiles_id(key, projection);
      ids.insert(id);
      ASSERT_EQ(key_of_archive_id(id, projection), key);
      if (key.zoom == 0) continue;
      const ArchivePosition at = *archive_position(id);
      const ArchivePosition above = *archive_position(pmtiles_id(parent_of(key), projection));
      ASSERT_EQ(above, (ArchivePosition{.zoom = at.zoom - 1, .x = at.x / 2, .y = at.y / 2}));
    }
    EXPECT_EQ(ids.size(), keys.size());
  }
  const TileKey deepest = {.zoom = kMaxZoom, .x = (2 << kMaxZoom) - 1, .y = 0};
  EXPECT_EQ(key_of_archive_id(pmtiles_id(deepest, Projection::kGeodetic), Projection::kGeodetic),
            deepest);
}

TEST(PmtilesId, GeodeticTilesStandOneZoomDeeperWithRowsFromTheNorth) {
  const auto at = [](const TileKey& key) {
    return *archive_position(pmtiles_id(key, Projection::kGeodetic));
  };
  EXPECT_EQ(at({.zoom = 0, .x = 1, .y = 0}), (ArchivePosition{.zoom = 1, .x = 1, .y = 0}));
  EXPECT_EQ(at({.zoom = 2, .x = 7, .y = 3}), (ArchivePosition{.zoom = 3, .x = 7, .y = 0}));
  EXPECT_EQ(at({.zoom = 2, .x = 7, .y = 0}), (ArchivePosition{.zoom = 3, .x = 7, .y = 3}));
  EXPECT_EQ(key_of_archive_id(0, Projection::kGeodetic), std::nullopt);
  EXPECT_EQ(key_of_archive_id(archive_id({.zoom = 1, .x = 0, .y = 1}), Projection::kGeodetic),
            std::nullopt);
}

TEST(Pmtiles, RandomSetsComeBackByteForByte) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE(::testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const TemporaryFolder folder;
  for (int trial = 0; trial < 20; ++trial) {
    const Projection projection = trial % 2 == 0 ? Projection::kGeodetic : Projection::kMercator;
    Tiles tiles;
    std::vector<TileKey> keys = every_key(projection, 5);
    std::shuffle(keys.begin(), keys.end(), random);
    keys.resize(1 + random() % keys.size());
    for (const TileKey& key : keys) {
      Bytes bytes(1 + random() % 40);
      // Few different bytes, so that some tiles are equal; a first byte that is not gzip's.
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(1 + random() % 2);
      tiles[key] = bytes;
    }
    const fs::path path = folder.path() / "set.pmtiles";
    pack(path, tiles, projection);
    const auto set = open_tile_set(path);
    ASSERT_EQ(set->keys().size(), tiles.size());
    ASSERT_THAT(set->strays(), IsEmpty());
    for (const auto& [key, bytes] : tiles) {
      ASSERT_EQ(*set->read(key), bytes);
      ASSERT_EQ(*set->stored_bytes(key), static_cast<std::int64_t>(bytes.size()));
    }
    std::sort(keys.begin(), keys.end());
    EXPECT_EQ(set->keys(), keys);
    EXPECT_EQ(*set->layer_text(), layer_text_of(projection));
  }
}

TEST(Pmtiles, TheSameTilesMakeTheSameBytes) {
  const TemporaryFolder folder;
  Tiles tiles;
  for (const TileKey& key : every_key(Projection::kGeodetic, 4)) {
    tiles[key] = Bytes(static_cast<std::size_t>(key.x) + 1, static_cast<std::uint8_t>(key.y));
  }
  pack(folder.path() / "a.pmtiles", tiles, Projection::kGeodetic);
  pack(folder.path() / "b.pmtiles", tiles, Projection::kGeodetic);
  EXPECT_TRUE(folder.get("a.pmtiles") == folder.get("b.pmtiles"));
}

TEST(Pmtiles, ManyTilesHaveLeavesAndARootWithinTheFirstBytes) {
  const TemporaryFolder folder;
  std::mt19937_64 random(7);
  Tiles tiles;
  for (std::int32_t x = 0; x < 400; ++x) {
    for (std::int32_t y = 0; y < 250; ++y) {
      Bytes bytes(1 + random() % 50, static_cast<std::uint8_t>(1 + random() % 9));
      tiles[{.zoom = 11, .x = 3 * x, .y = 5 * y}] = bytes;
    }
  }
  pack(folder.path() / "many.pmtiles", tiles, Projection::kGeodetic);
  const std::string file = folder.get("many.pmtiles");
  const PmtilesIndex index = index_of(file);
  EXPECT_GT(index.header.leaves.bytes, 0U);
  EXPECT_EQ(index.header.root.offset, kPmtilesHeaderBytes);
  EXPECT_LT(index.header.root.offset + index.header.root.bytes, kPmtilesRootEnd);
  EXPECT_EQ(index.header.addressed_tiles, 100000U);
  EXPECT_EQ(index.header.entries, index.entries.size());
  EXPECT_LE(index.header.contents, 450U);
  const auto set = open_pmtiles_set(folder.path() / "many.pmtiles");
  EXPECT_EQ(set->keys().size(), 100000U);
  for (const auto& [key, bytes] : tiles) ASSERT_EQ(*set->read(key), bytes);
}

TEST(Pmtiles, DirectoriesGrowUntilTheRootFits) {
  std::mt19937_64 random(11);
  std::vector<PmtilesEntry> entries(3000000);
  std::uint64_t id = 0;
  std::uint64_t offset = 0;
  for (PmtilesEntry& entry : entries) {
    id += 1 + random() % 1000;
    entry = {.id = id,
             .offset = offset,
             .bytes = 1 + static_cast<std::uint32_t>(random() % 90000),
             .run_length = 1};
    offset += entry.bytes;
  }
  const PmtilesDirectories directories = write_pmtiles_directories(entries);
  EXPECT_LT(kPmtilesHeaderBytes + directories.root.size(), kPmtilesRootEnd);
  EXPECT_GT(directories.root.size(), 1000U);
}

TEST(Pmtiles, EqualTilesAreStoredOnceAndNeighboursAreOneEntry) {
  const TemporaryFolder folder;
  Tiles tiles;
  for (const TileKey& key : every_key(Projection::kGeodetic, 5)) tiles[key] = Bytes(1000, 's');
  tiles[{.zoom = 3, .x = 2, .y = 2}] = Bytes(10, 'p');
  pack(folder.path() / "sea.pmtiles", tiles, Projection::kGeodetic);
  const PmtilesIndex index = index_of(folder.get("sea.pmtiles"));
  EXPECT_EQ(index.header.contents, 2U);
  EXPECT_EQ(index.header.tiles.bytes, 1010U);
  EXPECT_EQ(index.header.addressed_tiles, tiles.size());
  EXPECT_LT(index.entries.size(), 60U);
  EXPECT_EQ(*open_pmtiles_set(folder.path() / "sea.pmtiles")->read({.zoom = 5, .x = 63, .y = 31}),
            Bytes(1000, 's'));
}

TEST(Pmtiles, TheHeaderTellsZoomsBoundsAndCompression) {
  const TemporaryFolder folder;
  const Bytes packed = gzip_compress(Bytes(100, 'q'), 6);
  pack(folder.path() / "a.pmtiles",
       {{{.zoom = 2, .x = 0, .y = 0}, packed}, {{.zoom = 4, .x = 9, .y = 3}, packed}},
       Projection::kGeodetic);
  const PmtilesHeader header = index_of(folder.get("a.pmtiles")).header;
  EXPECT_EQ(header.min_zoom, 3);
  EXPECT_EQ(header.max_zoom, 5);
  EXPECT_EQ(header.tile_compression, PmtilesCompression::kGzip);
  EXPECT_EQ(header.directory_compression, PmtilesCompression::kGzip);
  EXPECT_TRUE(header.is_clustered);
  EXPECT_EQ(header.tile_type, 0);
  EXPECT_EQ(header.bounds_deg, (RectangleDeg{-10, 40.5, 20, 60}));
  EXPECT_EQ(header.centre_longitude_deg, 5);
  EXPECT_EQ(header.centre_latitude_deg, 50.25);
  pack(folder.path() / "b.pmtiles", {{{.zoom = 2, .x = 0, .y = 0}, Bytes{1}}},
       Projection::kMercator);
  const PmtilesHeader plain = index_of(folder.get("b.pmtiles")).header;
  EXPECT_EQ(plain.min_zoom, 2);
  EXPECT_EQ(plain.tile_compression, PmtilesCompression::kNone);
}

TEST(Pmtiles, AnUnfinishedArchiveLeavesTheOlderFileAndNothingElse) {
  const TemporaryFolder folder;
  folder.put("a.pmtiles", "older");
  const fs::path path = folder.path() / "a.pmtiles";
  EXPECT_THAT(io_error_of([&] { open_pmtiles_sink(path, Overwrite::kNo, Projection::kMercator); }),
              HasSubstr("--overwrite"));
  {
    const auto sink = open_pmtiles_sink(path, Overwrite::kYes, Projection::kMercator);
    sink->write({.zoom = 0, .x = 0, .y = 0}, Bytes{1, 2});
    sink->sync();
    EXPECT_TRUE(sink->has({.zoom = 0, .x = 0, .y = 0}));
    EXPECT_FALSE(sink->has({.zoom = 1, .x = 0, .y = 0}));
    EXPECT_THAT(io_error_of([&] { sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{}); }),
                HasSubstr("tile 1/0/0"));
  }
  EXPECT_EQ(folder.get("a.pmtiles"), "older");
  EXPECT_FALSE(folder.has("a.pmtiles.qmpipe-tmp"));
  EXPECT_THAT(io_error_of([&] {
                open_pmtiles_sink(path, Overwrite::kYes, Projection::kMercator)->close("{}");
              }),
              HasSubstr("there is no tile"));
}

// A small archive of ours, and one with uncompressed directories and a leaf, which damage to single
// bytes reaches into.
std::vector<std::string> archives_to_damage() {
  const TemporaryFolder folder;
  Tiles tiles;
  for (const TileKey& key : every_key(Projection::kGeodetic, 2)) {
    tiles[key] = Bytes(static_cast<std::size_t>(key.x) + 3, static_cast<std::uint8_t>(key.y));
  }
  pack(folder.path() / "a.pmtiles", tiles, Projection::kGeodetic);
  const std::vector<PmtilesEntry> in_leaf = {{.id = 2, .offset = 0, .bytes = 5, .run_length = 2},
                                             {.id = 9, .offset = 5, .bytes = 4, .run_length = 1}};
  const Bytes leaf = write_pmtiles_directory(in_leaf);
  const std::vector<PmtilesEntry> in_root = {
      {.id = 0, .offset = 0, .bytes = 5, .run_length = 1},
      {.id = 2, .offset = 0, .bytes = static_cast<std::uint32_t>(leaf.size()), .run_length = 0}};
  const Bytes root = write_pmtiles_directory(in_root);
  const std::string metadata = R"({"name":"other","tiling":"mercator"})";
  PmtilesHeader header;
  header.directory_compression = PmtilesCompression::kNone;
  header.root = {kPmtilesHeaderBytes, root.size()};
  header.metadata = {header.root.offset + root.size(), metadata.size()};
  header.leaves = {header.metadata.offset + metadata.size(), leaf.size()};
  header.tiles = {header.leaves.offset + leaf.size(), 9};
  Bytes file = write_pmtiles_header(header);
  for (const Bytes& part : {root, Bytes(metadata.begin(), metadata.end()), leaf, Bytes(9, 't')}) {
    file.insert(file.end(), part.begin(), part.end());
  }
  return {folder.get("a.pmtiles"), std::string(file.begin(), file.end())};
}

// Opens it and reads all that it claims to hold; whether it could be opened.
bool survives(const TemporaryFolder& folder, const std::string& file) {
  folder.put("damaged.pmtiles", file);
  try {
    const auto set = open_pmtiles_set(folder.path() / "damaged.pmtiles");
    std::size_t k = 0;
    // Damage may make a run of millions.
    for (const TileKey& key : set->keys()) {
      if (k++ == 1000) break;
      EXPECT_TRUE(set->read(key).ok()) << to_string(key);
    }
    EXPECT_TRUE(!set->layer_text().ok() || !set->layer_text()->empty());
    return true;
  } catch (const IoError&) {
    return false;
  }
}

TEST(PmtilesDamage, TruncatedArchivesAreRefused) {
  const TemporaryFolder folder;
  for (const std::string& whole : archives_to_damage()) {
    ASSERT_TRUE(survives(folder, whole));
    for (std::size_t bytes = 0; bytes < whole.size(); bytes += bytes < 300 ? 1 : 397) {
      ASSERT_FALSE(survives(folder, whole.substr(0, bytes))) << bytes;
    }
    ASSERT_FALSE(survives(folder, whole.substr(0, whole.size() - 1)));
  }
}

TEST(PmtilesDamage, ChangedBytesNeverCrashTheReader) {
  const std::uint64_t seed = std::random_device{}();
  SCOPED_TRACE(::testing::Message() << "seed " << seed);
  std::mt19937_64 random(seed);
  const TemporaryFolder folder;
  int refused = 0;
  for (const std::string& whole : archives_to_damage()) {
    for (int trial = 0; trial < 500; ++trial) {
      std::string damaged = whole;
      for (std::uint64_t k = 0; k <= random() % 3; ++k) {
        // Header and directories, not the gap behind them.
        damaged[random() % std::min<std::size_t>(whole.size(), 300)] = static_cast<char>(random());
      }
      if (!survives(folder, damaged)) ++refused;
    }
  }
  EXPECT_GT(refused, 100);
}

TEST(PmtilesDamage, WhatIsNoTileOfTheTilingIsListedAsAStray) {
  const TemporaryFolder folder;
  const std::string other = archives_to_damage()[1];
  folder.put("other.pmtiles", other);
  const auto set = open_pmtiles_set(folder.path() / "other.pmtiles");
  EXPECT_THAT(set->keys(),
              ElementsAre(TileKey{0, 0, 0}, TileKey{1, 0, 0}, TileKey{1, 1, 0}, TileKey{2, 0, 1}));
  EXPECT_FALSE(set->layer_text().ok());
  std::string as_geodetic = other;
  as_geodetic.replace(as_geodetic.find(R"("mercator")"), 10, R"("geodetic-z+1")");
  // The section grows; the sections behind it move.
  const PmtilesIndex index = index_of(other);
  PmtilesHeader header = index.header;
  header.metadata.bytes += 4;
  header.leaves.offset += 4;
  header.tiles.offset += 4;
  const Bytes start = write_pmtiles_header(header);
  as_geodetic.replace(0, start.size(), std::string(start.begin(), start.end()));
  folder.put("geodetic.pmtiles", as_geodetic);
  const auto strays = open_pmtiles_set(folder.path() / "geodetic.pmtiles")->strays();
  EXPECT_THAT(strays, ElementsAre("0/0/0", "1/0/1 and 1 more of its run", "2/0/2"));
}

}  // namespace
}  // namespace qmpipe::pmtiles_test
