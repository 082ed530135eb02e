#include "formats/mbtiles/mbtiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <map>

#include "formats/mbtiles/sqlite_file.h"
#include "formats/tile_sets/tile_output.h"
#include "tests/support/mbtiles_fixture.h"

namespace qmpipe::testing::sink_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
namespace fs = std::filesystem;

// The tiles as a set must have them: the last of each key.
std::map<TileKey, Bytes> content_of(const std::vector<Tile>& tiles) {
  std::map<TileKey, Bytes> content;
  for (const Tile& tile : tiles) content[tile.key] = tile.bytes;
  return content;
}

void expect_content(const fs::path& path, const std::map<TileKey, Bytes>& content) {
  const auto set = open_mbtiles_set(path);
  EXPECT_THAT(set->strays(), IsEmpty());
  ASSERT_EQ(set->keys().size(), content.size());
  for (const auto& [key, bytes] : content) {
    ASSERT_EQ(*set->read(key), bytes) << to_string(key);
    ASSERT_EQ(*set->stored_bytes(key), static_cast<std::int64_t>(bytes.size()));
  }
}

std::map<std::string, std::string> metadata_of(const fs::path& path) {
  Result<SqliteFile> file = SqliteFile::open(path, SqliteAccess::kRead, 1U << 20U);
  Result<SqliteStatement> row = file->prepare("SELECT name, value FROM metadata");
  std::map<std::string, std::string> metadata;
  while (*row->step()) {
    const auto text = [&](int column) {
      return std::string(row->bytes(column).begin(), row->bytes(column).end());
    };
    EXPECT_TRUE(metadata.emplace(text(0), text(1)).second) << text(0) << " is there twice";
  }
  return metadata;
}

std::int64_t number_from(const fs::path& path, const std::string& sql) {
  Result<SqliteFile> file = SqliteFile::open(path, SqliteAccess::kRead, 1U << 20U);
  Result<SqliteStatement> row = file->prepare(sql);
  EXPECT_TRUE(*row->step());
  return row->integer(0);
}

TEST_F(MbtilesSinkTest, WhatWasWrittenIsReadBackAndOneFileIsLeft) {
  const auto tiles = random_tiles(500, 1);
  const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
  for (const Tile& tile : tiles) {
    sink->write(tile.key, tile.bytes);
    ASSERT_TRUE(sink->has(tile.key));
  }
  EXPECT_FALSE(sink->has({.zoom = 6, .x = 0, .y = 0}));
  EXPECT_FALSE(fs::exists(path()));
  sink->close(write_layer_json(example_layer()));
  expect_content(path(), content_of(tiles));
  EXPECT_EQ(*open_mbtiles_set(path())->layer_text(), write_layer_json(example_layer()));
  for (const auto& entry : fs::directory_iterator(folder_.path())) EXPECT_EQ(entry.path(), path());
}

TEST_F(MbtilesSinkTest, EqualTilesAreStoredOnceAcrossAResumptionToo) {
  const Bytes sea(20000, 's');
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    for (std::int32_t x = 0; x < 50; ++x) sink->write({.zoom = 6, .x = x, .y = 3}, sea);
    sink->sync();
  }
  const auto sink = resume_mbtiles_sink(path());
  for (std::int32_t x = 50; x < 100; ++x) sink->write({.zoom = 6, .x = x, .y = 3}, sea);
  sink->close("{}");
  EXPECT_EQ(number_from(path(), "SELECT count(*) FROM tiles"), 100);
  EXPECT_EQ(number_from(path(), "SELECT count(*) FROM images"), 1);
  EXPECT_LT(fs::file_size(path()), 100000U);
  EXPECT_EQ(*open_mbtiles_set(path())->read({.zoom = 6, .x = 99, .y = 3}), sea);
}

TEST_F(MbtilesSinkTest, TheFileIsAsTheSpecificationHasIt) {
  const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
  sink->write({.zoom = 0, .x = 1, .y = 0}, Bytes{1});
  sink->write({.zoom = 3, .x = 9, .y = 6}, Bytes{2});
  sink->close(write_layer_json(example_layer()));
  EXPECT_EQ(number_from(path(), "PRAGMA application_id"), 0x4D504258);
  // Rows count from the south: y as it is.
  EXPECT_EQ(number_from(path(),
                        "SELECT count(*) FROM tiles WHERE zoom_level=3 AND tile_column=9 AND "
                        "tile_row=6 AND tile_data=x'02'"),
            1);
  const std::map<std::string, std::string> expected = {
      {"name", "Alps"},
      {"format", "application/vnd.quantized-mesh"},
      {"type", "baselayer"},
      {"scheme", "tms"},
      {"minzoom", "0"},
      {"maxzoom", "3"},
      {"bounds", "6,44.5,10,47"},
      {"center", "8,45.75,3"},
      {"attribution", "(c) Survey"},
      {"description", "A \"description\""},
      {"version", "1.0.0-abc"},
      {"crs", "EPSG:4326"},
      {"layer.json", write_layer_json(example_layer())}};
  EXPECT_EQ(metadata_of(path()), expected);
}

TEST_F(MbtilesSinkTest, AForeignLayerJsonIsStoredAsItIsAndTheRestIsLeftOut) {
  for (const std::string text : {"no JSON", "{\"tiles\": 7}", "", "{}"}) {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kYes);
    sink->write({.zoom = 2, .x = 1, .y = 0}, Bytes{1});
    sink->close(text);
    const auto metadata = metadata_of(path());
    EXPECT_EQ(metadata.at("layer.json"), text);
    EXPECT_EQ(metadata.at("name"), "out");
    EXPECT_EQ(metadata.at("format"), "application/vnd.quantized-mesh");
    EXPECT_EQ(metadata.at("minzoom"), "2");
    EXPECT_FALSE(metadata.contains("bounds"));
    EXPECT_EQ(*open_mbtiles_set(path())->layer_text(), text);
  }
}

TEST_F(MbtilesSinkTest, AnOlderFileStaysUntilTheNewOneIsWholeAndNoneOfItsTilesSurvives) {
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1});
    sink->close("{}");
  }
  const std::string older = file_bytes();
  EXPECT_THAT(io_error_of([&] { open_mbtiles_sink(path(), Overwrite::kNo); }),
              HasSubstr("the file is there\n  Choose another name, or pass --overwrite"));
  const std::function<std::unique_ptr<TileSink>()> ways[] = {
      [&] { return open_mbtiles_sink(path(), Overwrite::kYes); },
      [&] { return resume_mbtiles_sink(path()); }};
  for (const auto& open : ways) {
    const auto sink = open();
    sink->write({.zoom = 1, .x = 1, .y = 0}, Bytes{2});
    sink->sync();
    EXPECT_FALSE(sink->has({.zoom = 1, .x = 0, .y = 0}));
    EXPECT_TRUE(file_bytes() == older);
    sink->close("{}");
    EXPECT_THAT(open_mbtiles_set(path())->keys(), ElementsAre(TileKey{.zoom = 1, .x = 1, .y = 0}));
    folder_.put("out.mbtiles", older);
  }
}

TEST_F(MbtilesSinkTest, AReplacedTileIsTheNewOneAndItsImageIsGone) {
  const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
  const TileKey a = {.zoom = 1, .x = 0, .y = 0};
  const TileKey b = {.zoom = 1, .x = 1, .y = 0};
  sink->write(a, Bytes(9000, 'a'));
  sink->write(b, Bytes(9000, 'a'));
  sink->sync();
  sink->write(a, Bytes(8000, 'n'));
  sink->write(a, Bytes(7000, 'm'));
  sink->close("{}");
  expect_content(path(), {{a, Bytes(7000, 'm')}, {b, Bytes(9000, 'a')}});
  EXPECT_EQ(number_from(path(), "SELECT count(*) FROM images"), 2);
}

TEST_F(MbtilesSinkTest, AWorkingFileThatIsRemovedOrReplacedIsNoticed) {
  for (const bool is_replaced : {false, true}) {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kYes);
    sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1});
    sink->sync();
    fs::remove(working_path());
    if (is_replaced) folder_.put("out.mbtiles.qmpipe-tmp", "x");
    sink->write({.zoom = 1, .x = 1, .y = 0}, Bytes{1});
    EXPECT_THAT(io_error_of([&] { sink->sync(); }), HasSubstr("was removed or replaced"));
    EXPECT_THAT(io_error_of([&] { sink->close("{}"); }), HasSubstr("was removed or replaced"));
    EXPECT_FALSE(fs::exists(path()));
  }
}

TEST_F(MbtilesSinkTest, AWorkingFileOfSomethingElseIsRefused) {
  folder_.put("out.mbtiles.qmpipe-tmp", std::string(5000, 'x'));
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }),
              HasSubstr("not a database\n  The file is damaged: remove it"));
  fs::remove(working_path());
  {
    auto file = SqliteFile::open(working_path(), SqliteAccess::kWrite, 1000);
    ASSERT_FALSE(file->execute("CREATE TABLE photos (x)"));
  }
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }),
              HasSubstr("no unfinished tile set of this program"));
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1});
    sink->sync();
  }
  {
    auto file = SqliteFile::open(working_path(), SqliteAccess::kWrite, 1000);
    ASSERT_FALSE(file->execute("UPDATE images SET tile_id = 9000000000000000000"));
  }
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }),
              HasSubstr("image 9000000000000000000 cannot be"));
}

TEST_F(MbtilesSinkTest, APathThatCannotBeIsRefusedAtOnce) {
  folder_.put("file", "x");
  EXPECT_THAT(io_error_of([&] {
                open_mbtiles_sink(folder_.path() / "file" / "o.mbtiles", Overwrite::kNo);
              }),
              HasSubstr("A file stands where"));
  EXPECT_FALSE(fs::exists(path()));
}

TEST(TileOutput, TheFormIsToldByTheNameAndPmtilesAreRefusedWithTheWay) {
  EXPECT_EQ(form_of("a/b.mbtiles"), TileForm::kMbtiles);
  EXPECT_EQ(form_of("B.MBTiles"), TileForm::kMbtiles);
  EXPECT_EQ(form_of("b.pmtiles"), TileForm::kPmtiles);
  EXPECT_EQ(form_of("mbtiles"), TileForm::kFolder);
  EXPECT_EQ(form_of("a.mbtiles/b"), TileForm::kFolder);
  EXPECT_EQ(report_path("a/b.mbtiles"), "a/b.mbtiles.report.json");
  EXPECT_EQ(report_path("a/b"), "a/b/report.json");
  try {
    open_tile_sink("a/b.pmtiles", Overwrite::kNo);
    FAIL();
  } catch (const UsageError& error) {
    EXPECT_THAT(error.what(), HasSubstr("qmpipe convert a/b.mbtiles -o a/b.pmtiles"));
  }
}

}  // namespace
}  // namespace qmpipe::testing::sink_test
