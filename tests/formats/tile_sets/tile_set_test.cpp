#include "formats/tile_sets/open_tile_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include "formats/bytes/errors.h"
#include "formats/bytes/gzip.h"
#include "formats/tile/layer_json.h"
#include "formats/tile_sets/folder_sink.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::tile_set_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;

TEST(TileSet, WhatTheSinkWroteIsFoundSortedAndReadBack) {
  const TemporaryFolder folder;
  const auto sink = open_folder_sink(folder.path(), Overwrite::kNo);
  const std::vector<TileKey> keys = {{.zoom = 2, .x = 7, .y = 0}, {.zoom = 2, .x = 0, .y = 3},
                                     {.zoom = 0, .x = 1, .y = 0}, {.zoom = 0, .x = 0, .y = 0},
                                     {.zoom = 2, .x = 1, .y = 0}, {.zoom = 10, .x = 12, .y = 9}};
  for (const TileKey& key : keys) {
    sink->write(key, Bytes(static_cast<std::size_t>(key.x), 'q'));
  }
  sink->close(write_layer_json(LayerJson()));
  const auto tiles = open_tile_set(folder.path());
  std::vector<TileKey> sorted = keys;
  std::sort(sorted.begin(), sorted.end());
  EXPECT_EQ(tiles->keys(), sorted);
  EXPECT_THAT(tiles->strays(), IsEmpty());
  for (const TileKey& key : keys) {
    EXPECT_EQ(*tiles->read(key), Bytes(static_cast<std::size_t>(key.x), 'q'));
    EXPECT_EQ(*tiles->stored_bytes(key), key.x);
  }
  EXPECT_EQ(*tiles->layer_text(), write_layer_json({}));
  EXPECT_EQ(open_tile_set(folder.path() / "layer.json")->keys(), sorted);
}

TEST(TileSet, JunkIsPassedOverAndTileLikeJunkIsListed) {
  const TemporaryFolder folder;
  for (const char* name :
       {"0/0/0.terrain", "0/readme.txt", "0/0/0.txt", "viewer/0/0.terrain", "notes", "1/0/.terrain",
        "1/0/-1.terrain", "1/0/01.terrain", "1/0/99999999999.terrain", "1/0/2.terrain",
        "1/4/0.terrain", "1/x/0.terrain", "1/0/1.terrain.qmpipe-tmp", "25/0/0.terrain",
        "00/0/0.terrain", "top.terrain", "1/side.terrain", "1/0/1e0.terrain"}) {
    folder.put(name, "x");
  }
  std::filesystem::create_directory(folder.path() / "0/1");
  std::filesystem::create_directory(folder.path() / "0/1/0.terrain");
  std::filesystem::create_symlink("nowhere", folder.path() / "0/0/dangling");
  std::filesystem::create_directory_symlink("..", folder.path() / "0/7");
  ASSERT_EQ(::mkfifo((folder.path() / "1/0/0.terrain").c_str(), 0600), 0);
  const auto tiles = open_tile_set(folder.path());
  EXPECT_THAT(tiles->keys(), ElementsAre(TileKey{.zoom = 0, .x = 0, .y = 0}));
  EXPECT_THAT(
      tiles->strays(),
      ElementsAre("0/1/0.terrain", "0/7/top.terrain", "00/0/0.terrain", "1/0/-1.terrain",
                  "1/0/.terrain", "1/0/0.terrain", "1/0/01.terrain", "1/0/1.terrain.qmpipe-tmp",
                  "1/0/1e0.terrain", "1/0/2.terrain", "1/0/99999999999.terrain", "1/4/0.terrain",
                  "1/side.terrain", "1/x/0.terrain", "25/0/0.terrain", "top.terrain"));
  EXPECT_FALSE(tiles->read({.zoom = 1, .x = 0, .y = 0}).ok());
  EXPECT_FALSE(tiles->layer_text().ok());
}

TEST(TileSet, WhatIsNoTileSetIsRefusedWithARemedy) {
  const TemporaryFolder folder;
  folder.put("file", "x");
  const auto message = [](const std::filesystem::path& path) -> std::string {
    try {
      open_tile_set(path);
    } catch (const IoError& error) {
      return error.what();
    }
    return "opened";
  };
  EXPECT_THAT(message(folder.path()), HasSubstr("neither a layer.json nor a tile"));
  EXPECT_THAT(message(folder.path() / "none"),
              HasSubstr("no such file or folder\n  Check the path"));
  EXPECT_THAT(message(folder.path() / "file"),
              HasSubstr("neither a folder nor an .mbtiles or .pmtiles file\n  Name the folder"));
  folder.put("layer.json", "{}");
  EXPECT_EQ(message(folder.path()), "opened");
}

TEST(TileSet, AMissingTileIsAnErrorThatNamesTheFile) {
  const TemporaryFolder folder;
  folder.put("layer.json", "{}");
  const auto tiles = open_tile_set(folder.path());
  const auto missing = tiles->read({.zoom = 3, .x = 2, .y = 1});
  ASSERT_FALSE(missing.ok());
  EXPECT_THAT(missing.error().message, HasSubstr("3/2/1.terrain: No such file"));
  EXPECT_FALSE(tiles->stored_bytes({.zoom = 3, .x = 2, .y = 1}).ok());
}

TEST(PlainTileBytes, GzipIsTakenOffWhereThereIsAny) {
  const Bytes plain = {5, 6, 7};
  EXPECT_EQ(*plain_tile_bytes(plain), plain);
  EXPECT_EQ(*plain_tile_bytes(gzip_compress(plain, 6)), plain);
  EXPECT_TRUE(plain_tile_bytes({})->empty());
  Bytes damaged = gzip_compress(plain, 6);
  damaged.back() ^= 1U;
  EXPECT_FALSE(plain_tile_bytes(damaged).ok());
}

}  // namespace
}  // namespace qmpipe::tile_set_test
