#include "pipeline/convert/convert.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <atomic>
#include <bit>
#include <map>
#include <stdexcept>

#include "formats/bytes/errors.h"
#include "formats/bytes/gzip.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/pmtiles/pmtiles.h"
#include "formats/tile/layer_json.h"
#include "formats/tile_sets/folder_sink.h"
#include "formats/tile_sets/open_tile_set.h"
#include "pipeline/run/ordered_work.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::convert_test {
namespace {

using ::testing::Contains;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SetFixture;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;
namespace fs = std::filesystem;

// Made once: the tests below do not change it.
const SetFixture& sound_set() {
  static const SetFixture set(testing::sixteen_tiles());
  return set;
}

ConvertReport convert_to(const fs::path& input, const fs::path& output,
                         ConvertOptions options = {}) {
  options.output = output;
  Progress progress(ProgressStyle::kSilent, nullptr);
  return convert(*open_tile_set(input), options, progress);
}

template <class Error, class Action>
std::string message_of(const Action& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "nothing was thrown";
}

std::map<TileKey, Bytes> tiles_of(const fs::path& path) {
  const auto set = open_tile_set(path);
  std::map<TileKey, Bytes> tiles;
  for (const TileKey& key : set->keys()) tiles[key] = *set->read(key);
  return tiles;
}

std::string file_name(const std::string& form, std::int32_t threads) {
  // An MBTiles file tells its own name.
  return "by" + std::to_string(threads) + "/set." + form;
}

// A folder with one tile of other compression among gzipped ones.
void make_mixed(const TemporaryFolder& folder, const TileKey& plain_one) {
  fs::copy(sound_set().path(), folder.path() / "mixed", fs::copy_options::recursive);
  const Bytes plain = *plain_tile_bytes(*open_tile_set(sound_set().path())->read(plain_one));
  folder.put("mixed/" + to_string(plain_one) + ".terrain", std::string(plain.begin(), plain.end()));
}

TEST(Convert, AllFormsInTurnKeepEveryByteOfTilesAndLayer) {
  const TemporaryFolder folder;
  const fs::path& at = folder.path();
  const ConvertReport report = convert_to(sound_set().path(), at / "a.mbtiles");
  EXPECT_EQ(report.tiles, 16);
  EXPECT_EQ(report.repacked_tiles, 0);
  EXPECT_EQ(report.read_bytes, report.written_bytes);
  EXPECT_THAT(report.notes, IsEmpty());
  convert_to(at / "a.mbtiles", at / "b.pmtiles");
  convert_to(at / "b.pmtiles", at / "c");
  convert_to(at / "c", at / "d.pmtiles");
  convert_to(at / "d.pmtiles", at / "e" / "a.mbtiles");
  const auto wanted = tiles_of(sound_set().path());
  EXPECT_EQ(wanted.size(), 16U);
  const std::string layer = *open_tile_set(sound_set().path())->layer_text();
  for (const char* name : {"a.mbtiles", "b.pmtiles", "c", "d.pmtiles", "e/a.mbtiles"}) {
    EXPECT_EQ(tiles_of(at / name), wanted) << name;
    EXPECT_EQ(*open_tile_set(at / name)->layer_text(), layer) << name;
  }
  EXPECT_TRUE(folder.get("a.mbtiles") == folder.get("e/a.mbtiles"));
  EXPECT_TRUE(folder.get("b.pmtiles") == folder.get("d.pmtiles"));
}

TEST(Convert, TheOutputDoesNotDependOnThreads) {
  const TemporaryFolder folder;
  for (const char* form : {"pmtiles", "mbtiles"}) {
    for (const std::int32_t threads : {1, 2, 8}) {
      convert_to(sound_set().path(), folder.path() / file_name(form, threads),
                 {.packing = Packing::kGzip, .gzip_level = 9, .threads = threads});
    }
    EXPECT_TRUE(folder.get(file_name(form, 1)) == folder.get(file_name(form, 2)));
    EXPECT_TRUE(folder.get(file_name(form, 1)) == folder.get(file_name(form, 8)));
  }
}

TEST(Convert, TilesAreUnpackedAndPackedOnDemand) {
  const TemporaryFolder folder;
  const ConvertReport plain =
      convert_to(sound_set().path(), folder.path() / "plain", {.packing = Packing::kPlain});
  EXPECT_EQ(plain.repacked_tiles, 16);
  const auto wanted = tiles_of(sound_set().path());
  for (const auto& [key, bytes] : tiles_of(folder.path() / "plain")) {
    EXPECT_FALSE(is_gzip(bytes));
    EXPECT_EQ(bytes, *plain_tile_bytes(wanted.at(key)));
  }
  EXPECT_EQ(convert_to(folder.path() / "plain", folder.path() / "kept.pmtiles").repacked_tiles, 0);
  EXPECT_EQ(tiles_of(folder.path() / "kept.pmtiles"), tiles_of(folder.path() / "plain"));
  // The fixture packs at level 1.
  convert_to(folder.path() / "plain", folder.path() / "again.mbtiles",
             {.packing = Packing::kGzip, .gzip_level = 1});
  EXPECT_EQ(tiles_of(folder.path() / "again.mbtiles"), wanted);
}

TEST(Convert, AnArchiveOfAMixedSetIsGzippedThroughoutAndSaysSo) {
  const auto wanted = tiles_of(sound_set().path());
  // The first tile of an archive, and a later one.
  for (const TileKey& key : {TileKey{0, 0, 0}, testing::kLeaf}) {
    const TemporaryFolder folder;
    make_mixed(folder, key);
    const ConvertReport report = convert_to(folder.path() / "mixed", folder.path() / "one.pmtiles");
    EXPECT_EQ(report.tiles, 16);
    EXPECT_EQ(report.repacked_tiles, 1);
    EXPECT_THAT(report.notes, Contains(HasSubstr("1 of 16 tiles were not gzipped")));
    for (const auto& [tile, bytes] : tiles_of(folder.path() / "one.pmtiles")) {
      EXPECT_TRUE(tile == key || bytes == wanted.at(tile));
      EXPECT_TRUE(is_gzip(bytes));
      EXPECT_EQ(*plain_tile_bytes(bytes), *plain_tile_bytes(wanted.at(tile)));
    }
    convert_to(folder.path() / "mixed", folder.path() / "kept.mbtiles");
    EXPECT_EQ(tiles_of(folder.path() / "kept.mbtiles"), tiles_of(folder.path() / "mixed"));
  }
}

TEST(Convert, APlainTileThatLooksGzippedDoesNoHarm) {
  const TileKey key = {0, 0, 0};
  SetFixture set(testing::sixteen_tiles());
  set.change(key, [](QuantizedMesh& mesh) {
    std::uint64_t bits = std::bit_cast<std::uint64_t>(mesh.header.centre_ecef_m[0]);
    bits = (bits & ~0xFFFFFFFFULL) | 0x00088B1F;
    mesh.header.centre_ecef_m[0] = std::bit_cast<double>(bits);
  });
  const TemporaryFolder folder;
  const ConvertReport report =
      convert_to(set.path(), folder.path() / "plain.pmtiles", {.packing = Packing::kPlain});
  EXPECT_EQ(report.repacked_tiles, 16);
  EXPECT_THAT(report.notes, IsEmpty());
  const Bytes stored = tiles_of(folder.path() / "plain.pmtiles").at(key);
  ASSERT_TRUE(is_gzip(stored));
  EXPECT_TRUE(decode(stored).ok());
  // Taken for a mixed set, and gzipped like the others.
  convert_to(folder.path() / "plain.pmtiles", folder.path() / "packed.pmtiles");
  const Bytes packed = tiles_of(folder.path() / "packed.pmtiles").at(key);
  ASSERT_TRUE(plain_tile_bytes(packed).ok());
  EXPECT_TRUE(*plain_tile_bytes(packed) == stored);
}

TEST(Convert, ATileThatCannotBeReadEndsItWithItsNameAndLeavesNoFile) {
  for (const char* name : {"out.pmtiles", "out.mbtiles"}) {
    const TemporaryFolder folder;
    make_mixed(folder, testing::kLeaf);
    folder.put(name, "older");
    folder.put("mixed/2/1/2.terrain", "\x1F\x8B\x08\x01 damaged");
    const auto error = message_of<IoError>([&] {
      convert_to(folder.path() / "mixed", folder.path() / name,
                 {.overwrite = Overwrite::kYes, .packing = Packing::kPlain, .threads = 4});
    });
    EXPECT_THAT(error, HasSubstr("tile 2/1/2: the gzip data"));
    EXPECT_TRUE(folder.get(name) == "older");
    const auto entries = fs::directory_iterator(folder.path());
    EXPECT_EQ(std::distance(fs::begin(entries), fs::end(entries)), 2)
        << "the set and the older file";
  }
}

TEST(Convert, AnInterruptionLeavesNoFile) {
  for (const char* name : {"out.pmtiles", "out.mbtiles"}) {
    const TemporaryFolder folder;
    const std::atomic<bool> stop = true;
    Progress progress(ProgressStyle::kSilent, &stop);
    const auto set = open_tile_set(sound_set().path());
    const auto error =
        message_of<Interrupted>([&] { convert(*set, {.output = folder.path() / name}, progress); });
    EXPECT_EQ(error, "stopped after 0 of 16 tiles; nothing is left of the output");
    EXPECT_TRUE(fs::is_empty(folder.path()));
  }
}

TEST(Convert, ALayerThatMisleadsClientsIsPutRightAndStraysAreLeftOut) {
  const TemporaryFolder folder;
  fs::copy(sound_set().path(), folder.path() / "set", fs::copy_options::recursive);
  fs::remove(folder.path() / "set" / "layer.json");
  folder.put("set/1/0/9.terrain", "outside");
  const ConvertReport report = convert_to(folder.path() / "set", folder.path() / "a.mbtiles");
  EXPECT_EQ(report.strays, 1);
  EXPECT_THAT(report.notes, Contains(HasSubstr("1/0/9.terrain")));
  EXPECT_THAT(report.notes, Contains(HasSubstr("layer.json: it is made from the tiles")));
  const auto parsed = parse_layer_json(*open_tile_set(folder.path() / "a.mbtiles")->layer_text());
  ASSERT_TRUE(parsed.ok());
  EXPECT_EQ(parsed->layer.max_zoom, 3);
  EXPECT_EQ(parsed->layer.name, "a");
}

TEST(Convert, TilesOutsideTheTilingAreRefusedByName) {
  const TemporaryFolder folder;
  fs::copy(sound_set().path(), folder.path() / "set", fs::copy_options::recursive);
  std::string layer = *open_tile_set(folder.path() / "set")->layer_text();
  layer.replace(layer.find("EPSG:4326"), 9, "EPSG:3857");
  folder.put("set/layer.json", layer);
  EXPECT_THAT(
      message_of<IoError>([&] { convert_to(folder.path() / "set", folder.path() / "a.pmtiles"); }),
      HasSubstr("tile 0/1/0 lies outside the tiling that layer.json names (EPSG:3857)"));
  EXPECT_FALSE(folder.has("a.pmtiles"));
}

TEST(Convert, MercatorSetsKeepTheirZoomInAnArchive) {
  const TemporaryFolder folder;
  LayerJson layer;
  layer.projection = Projection::kMercator;
  layer.max_zoom = 1;
  layer.available = {{{0, 0, 0, 0}}, {{1, 0, 1, 0}}};
  const auto sink = open_folder_sink(folder.path() / "set", Overwrite::kNo);
  sink->write({0, 0, 0}, Bytes{1});
  sink->write({1, 1, 0}, Bytes{2});
  sink->close(write_layer_json(layer));
  convert_to(folder.path() / "set", folder.path() / "a.pmtiles");
  EXPECT_EQ(pmtiles_id({1, 1, 0}, Projection::kMercator), 3U);
  convert_to(folder.path() / "a.pmtiles", folder.path() / "back");
  EXPECT_EQ(tiles_of(folder.path() / "back"), tiles_of(folder.path() / "set"));
}

TEST(OrderedWork, ResultsComeInOrderAndEachOnce) {
  std::vector<std::int64_t> taken;
  const std::int64_t done = work_in_order(
      8, 5000,
      [&](std::int64_t index) -> InTurn {
        return [&taken, index] {
          taken.push_back(index);
          return true;
        };
      },
      [] { return false; });
  EXPECT_EQ(done, 5000);
  ASSERT_EQ(taken.size(), 5000U);
  for (std::int64_t k = 0; k < 5000; ++k) ASSERT_EQ(taken[static_cast<std::size_t>(k)], k);
}

TEST(OrderedWork, ItEndsWhereItIsToldTo) {
  std::int64_t calls = 0;
  const auto until_ten = [&](std::int64_t index) -> InTurn {
    return [&calls, index] {
      ++calls;
      return index < 10;
    };
  };
  EXPECT_EQ(work_in_order(4, 1000, until_ten, [] { return false; }), 10);
  EXPECT_EQ(calls, 11);
  EXPECT_EQ(work_in_order(4, 1000, until_ten, [] { return true; }), 0);
  const auto faulty = [](std::int64_t index) -> InTurn {
    if (index == 7) throw std::runtime_error("seven");
    return [] { return true; };
  };
  EXPECT_EQ(
      message_of<std::runtime_error>([&] { work_in_order(4, 1000, faulty, [] { return false; }); }),
      "seven");
}

}  // namespace
}  // namespace qmpipe::convert_test
