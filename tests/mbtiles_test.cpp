#include "formats/mbtiles.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <map>
#include <random>
#include <thread>

#include "formats/errors.h"
#include "formats/file_bytes.h"
#include "formats/layer_json.h"
#include "formats/sqlite_file.h"
#include "formats/tile_output.h"
#include "tests/file_size_limit.h"
#include "tests/small_disk.h"
#include "tests/temporary_folder.h"

namespace qmpipe {
namespace {

using ::testing::ElementsAre;
using testing::FileSizeLimit;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::SmallDisk;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;
namespace fs = std::filesystem;

struct Tile {
  TileKey key;
  Bytes bytes;
};

LayerJson example_layer() {
  LayerJson layer;
  layer.name = "Alps";
  layer.description = "A \"description\"";
  layer.attribution = "(c) Survey";
  layer.version = "1.0.0-abc";
  layer.min_zoom = 0;
  layer.max_zoom = 3;
  layer.bounds_deg = {.west_deg = 6, .south_deg = 44.5, .east_deg = 10, .north_deg = 47};
  return layer;
}

std::string io_error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const IoError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

// Rows of one zoom as a build writes them; sizes from nothing to several pages, a third of them
// equal to others.
std::vector<Tile> random_tiles(std::int32_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Tile> tiles;
  for (std::int32_t k = 0; k < count; ++k) {
    const auto pick = random() % 3;
    Bytes bytes;
    if (pick == 0) {
      bytes.assign(random() % 40, static_cast<std::uint8_t>(random() % 5));
    } else {
      bytes.resize(random() % (pick == 1 ? 3000 : 30000));
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    }
    tiles.push_back({{.zoom = 7, .x = (k * 37) % 250, .y = k / 8 % 100}, std::move(bytes)});
  }
  return tiles;
}

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

class MbtilesSinkTest : public ::testing::Test {
 protected:
  fs::path path() const { return folder_.path() / "out.mbtiles"; }
  fs::path working_path() const { return folder_.path() / "out.mbtiles.qmpipe-tmp"; }
  std::string file_bytes() const { return folder_.get("out.mbtiles"); }

  // One run without any interruption.
  std::string written_at_once(const std::vector<Tile>& tiles) const {
    const auto sink = open_mbtiles_sink(folder_.path() / "once.mbtiles", Overwrite::kYes);
    for (const Tile& tile : tiles) sink->write(tile.key, tile.bytes);
    sink->close(write_layer_json(example_layer()));
    return folder_.get("once.mbtiles");
  }

  const TemporaryFolder folder_;
};

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

TEST_F(MbtilesSinkTest, WhereSyncWasCalledLeavesNoTraceInTheBytes) {
  const unsigned seed = std::random_device()();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  const auto tiles = random_tiles(800, seed);
  const std::string expected = written_at_once(tiles);
  for (int run = 0; run < 5; ++run) {
    const std::uint64_t every = 1 + random() % 200;
    const auto sink = open_mbtiles_sink(path(), Overwrite::kYes);
    for (const Tile& tile : tiles) {
      sink->write(tile.key, tile.bytes);
      if (random() % every == 0) sink->sync();
    }
    sink->close(write_layer_json(example_layer()));
    ASSERT_TRUE(file_bytes() == expected) << "a sync about every " << every << " tiles";
  }
}

// Writes tiles from `first` on in a process of its own, which kills itself before tile `last`; each
// tile that follows a sync() makes the pipe's number grow. Returns the tiles that are surely kept.
std::size_t killed_run(const fs::path& path, const std::vector<Tile>& tiles, std::size_t first,
                       std::size_t last, std::uint64_t every) {
  int ends[2] = {};
  EXPECT_EQ(::pipe(ends), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    std::mt19937 random(static_cast<unsigned>(last));
    const auto sink =
        first == 0 ? open_mbtiles_sink(path, Overwrite::kYes) : resume_mbtiles_sink(path);
    for (std::size_t k = first; k < last; ++k) {
      sink->write(tiles[k].key, tiles[k].bytes);
      if (random() % every != 0) continue;
      sink->sync();
      const std::size_t kept = k + 1;
      if (::write(ends[1], &kept, sizeof kept) != sizeof kept) ::_exit(1);
    }
    ::raise(SIGKILL);
  }
  ::close(ends[1]);
  std::size_t kept = first;
  for (std::size_t next = 0; ::read(ends[0], &next, sizeof next) == sizeof next;) kept = next;
  ::close(ends[0]);
  int status = 0;
  EXPECT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFSIGNALED(status));
  return kept;
}

TEST_F(MbtilesSinkTest, RunsThatWereKilledEndWithTheSameBytesAndLoseNothingSynced) {
  const unsigned seed = std::random_device()();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  // More than the page cache holds, so that a kill finds pages of a transaction in the file.
  const auto tiles = random_tiles(2000, seed);
  const std::string expected = written_at_once(tiles);
  for (int run = 0; run < 4; ++run) {
    std::size_t kept = 0;
    for (int kill = 0; kill < 4; ++kill) {
      const std::size_t last = kept + random() % (tiles.size() - kept + 1);
      kept = killed_run(path(), tiles, kept, last, 1 + random() % 400);
    }
    const auto sink = resume_mbtiles_sink(path());
    for (std::size_t k = 0; k < kept; ++k) ASSERT_TRUE(sink->has(tiles[k].key));
    // A journal may count less than the sink has.
    for (std::size_t k = random() % (kept + 1); k < tiles.size(); ++k) {
      sink->write(tiles[k].key, tiles[k].bytes);
      if (random() % 300 == 0) sink->sync();
    }
    sink->close(write_layer_json(example_layer()));
    ASSERT_TRUE(file_bytes() == expected);
  }
}

TEST_F(MbtilesSinkTest, AKillAfterTheLastCommitEndsWithTheSameBytes) {
  const auto tiles = random_tiles(200, 5);
  const std::string expected = written_at_once(tiles);
  const std::string layer = write_layer_json(example_layer());
  // Closed and patched, but not renamed.
  folder_.put("out.mbtiles.qmpipe-tmp", expected);
  resume_mbtiles_sink(path())->close(layer);
  EXPECT_TRUE(file_bytes() == expected);
  // Renamed, but nobody was told.
  const auto time = fs::last_write_time(path());
  {
    const auto sink = resume_mbtiles_sink(path());
    for (const Tile& tile : tiles) EXPECT_TRUE(sink->has(tile.key));
    sink->sync();
    sink->close(layer);
  }
  EXPECT_TRUE(file_bytes() == expected);
  EXPECT_EQ(fs::last_write_time(path()), time);
  EXPECT_FALSE(fs::exists(working_path()));
  // That file is another run's.
  const auto sink = resume_mbtiles_sink(path());
  EXPECT_THAT(io_error_of([&] { sink->close("{}"); }), HasSubstr("is another tile set"));
  EXPECT_TRUE(file_bytes() == expected);
  // Nor is it one that lacks a tile of those that a run counts on.
  const auto other = resume_mbtiles_sink(path());
  EXPECT_TRUE(other->has(tiles[0].key));
  EXPECT_THAT(io_error_of([&] { other->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1}); }),
              HasSubstr("is another tile set\n  Run the same command with --overwrite"));
  EXPECT_FALSE(fs::exists(working_path()));
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
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }), HasSubstr("not a database"));
  fs::remove(working_path());
  {
    auto file = SqliteFile::open(working_path(), SqliteAccess::kWrite, 1000);
    ASSERT_FALSE(file->execute("CREATE TABLE photos (x)"));
  }
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }),
              HasSubstr("no unfinished tile set of this program"));
}

TEST_F(MbtilesSinkTest, AnotherProcessIsKeptOutWhileOneIsAtWork) {
  int ready[2] = {};
  int done[2] = {};
  ASSERT_EQ(::pipe(ready), 0);
  ASSERT_EQ(::pipe(done), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1});
    sink->sync();
    char byte = 'r';
    if (::write(ready[1], &byte, 1) != 1 || ::read(done[0], &byte, 1) != 1) ::_exit(1);
    sink->close("{}");
    ::_exit(0);
  }
  char byte = 'd';
  ASSERT_EQ(::read(ready[0], &byte, 1), 1);
  const char* const said = "another run is at work with it\n  Wait for that run";
  EXPECT_THAT(io_error_of([&] { resume_mbtiles_sink(path()); }), HasSubstr(said));
  EXPECT_THAT(io_error_of([&] { open_mbtiles_sink(path(), Overwrite::kYes); }), HasSubstr(said));
  ASSERT_EQ(::write(done[1], &byte, 1), 1);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_EQ(status, 0);
  EXPECT_EQ(open_mbtiles_set(path())->keys().size(), 1U);
  for (const int end : {ready[0], ready[1], done[0], done[1]}) ::close(end);
}

TEST_F(MbtilesSinkTest, SyncMayRunBesideWrite) {
  const auto tiles = random_tiles(1500, 9);
  const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
  {
    std::jthread syncer([&](const std::stop_token& stop) {
      while (!stop.stop_requested()) sink->sync();
    });
    for (const Tile& tile : tiles) sink->write(tile.key, tile.bytes);
  }
  sink->close(write_layer_json(example_layer()));
  EXPECT_TRUE(file_bytes() == written_at_once(tiles));
}

TEST_F(MbtilesSinkTest, AFullDiskIsToldWithARemedyAndWhatWasSyncedIsGoneOnWith) {
  const SmallDisk disk(folder_.path());
  if (!disk.is_mounted()) GTEST_SKIP() << "no right to mount a small disk here";
  const auto tiles = random_tiles(400, 11);
  std::size_t synced = 0;
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    const std::string message = io_error_of([&] {
      for (std::size_t k = 0; k < tiles.size(); ++k) {
        sink->write(tiles[k].key, tiles[k].bytes);
        if (k % 20 != 19) continue;
        sink->sync();
        synced = k + 1;
      }
    });
    EXPECT_THAT(message, HasSubstr("full\n  Free some space"));
    // SQLite may have rolled back tiles, so nothing may seem to be synced from here on.
    EXPECT_THAT(io_error_of([&] { sink->sync(); }), HasSubstr("failed before"));
    EXPECT_THAT(io_error_of([&] { sink->close("{}"); }), HasSubstr("failed before"));
  }
  EXPECT_GT(synced, 0U);
  ASSERT_EQ(::mount("tmpfs", folder_.path().c_str(), "tmpfs", MS_REMOUNT, "size=40m"), 0);
  const auto sink = resume_mbtiles_sink(path());
  for (std::size_t k = 0; k < synced; ++k) EXPECT_TRUE(sink->has(tiles[k].key));
  for (std::size_t k = synced; k < tiles.size(); ++k) sink->write(tiles[k].key, tiles[k].bytes);
  sink->close(write_layer_json(example_layer()));
  EXPECT_TRUE(file_bytes() == written_at_once(tiles));
}

TEST_F(MbtilesSinkTest, ALimitOnFileSizesIsToldWithARemedy) {
  const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
  const FileSizeLimit limit(300000);
  EXPECT_THAT(io_error_of([&] {
                for (const Tile& tile : random_tiles(100, 3)) sink->write(tile.key, tile.bytes);
                sink->sync();
              }),
              HasSubstr("disk I/O error\n  Check the disk, its quota and the limit"));
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
    EXPECT_THAT(error.what(), HasSubstr("qmpipe convert a/b.mbtiles a/b.pmtiles"));
  }
}

}  // namespace
}  // namespace qmpipe
