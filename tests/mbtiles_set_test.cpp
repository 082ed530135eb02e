#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <thread>

#include "formats/errors.h"
#include "formats/mbtiles.h"
#include "formats/sqlite_file.h"
#include "tests/temporary_folder.h"

namespace qmpipe {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;
namespace fs = std::filesystem;

const char* const kPlainTiles =
    "CREATE TABLE metadata (name text, value text);"
    "CREATE TABLE tiles (zoom_level integer, tile_column integer, tile_row integer,"
    " tile_data blob);";

class MbtilesSetTest : public ::testing::Test {
 protected:
  fs::path path() const { return folder_.path() / "set.mbtiles"; }
  // Another program's file.
  void run_sql(const std::string& sql) const {
    Result<SqliteFile> file = SqliteFile::open(path(), SqliteAccess::kWrite, 1U << 20U);
    ASSERT_TRUE(file.ok());
    const auto error = file->execute(sql);
    ASSERT_FALSE(error.has_value()) << error->message;
  }
  std::string refusal() const {
    try {
      open_mbtiles_set(path());
    } catch (const IoError& error) {
      return error.what();
    }
    return "opened";
  }
  const TemporaryFolder folder_;
};

TEST_F(MbtilesSetTest, APlainTableIsReadAndWhatCanBeNoTileIsListed) {
  run_sql(std::string(kPlainTiles) +
          "INSERT INTO metadata VALUES ('name', 'x'), ('layer_json', '{\"a\": 1}');"
          "INSERT INTO tiles VALUES (0, 0, 0, x'0102'), (2, 7, 3, x''), (2, 1, 0, x'05'),"
          " (1, 4, 0, x'00'), (1, 0, 2, x'00'), (-1, 0, 0, x'00'), (22, 0, 0, x'00'),"
          " (1, -1, 0, x'00'), (9223372036854775807, 0, 0, x'00'), ('a', NULL, 0.5, x'00'),"
          " (0, 0, 0, x'09');");
  const auto set = open_mbtiles_set(path());
  EXPECT_THAT(set->keys(),
              ElementsAre(TileKey{.zoom = 0, .x = 0, .y = 0}, TileKey{.zoom = 2, .x = 1, .y = 0},
                          TileKey{.zoom = 2, .x = 7, .y = 3}));
  EXPECT_THAT(set->strays(), ElementsAre("-1/0/0", "0/0/0 (again)", "1/-1/0", "1/0/2", "1/4/0",
                                         "22/0/0", "9223372036854775807/0/0", "a/NULL/0.5"));
  EXPECT_EQ(*set->layer_text(), "{\"a\": 1}");
  EXPECT_EQ(*set->read({.zoom = 2, .x = 1, .y = 0}), Bytes{5});
  EXPECT_THAT(*set->read({.zoom = 2, .x = 7, .y = 3}), IsEmpty());
  EXPECT_EQ(*set->stored_bytes({.zoom = 0, .x = 0, .y = 0}), 2);
  const auto missing = set->read({.zoom = 2, .x = 0, .y = 0});
  ASSERT_FALSE(missing.ok());
  EXPECT_THAT(missing.error().message, HasSubstr("there is no tile 2/0/0"));
}

TEST_F(MbtilesSetTest, RowsFromTheNorthAreTurnedRound) {
  run_sql(std::string(kPlainTiles) +
          "INSERT INTO tiles VALUES (0, 1, 0, x'01'), (3, 9, 0, x'02'), (3, 9, 6, x'03')");
  const auto set = open_mbtiles_set(path(), RowOrder::kXyz);
  EXPECT_THAT(set->keys(),
              ElementsAre(TileKey{.zoom = 0, .x = 1, .y = 0}, TileKey{.zoom = 3, .x = 9, .y = 1},
                          TileKey{.zoom = 3, .x = 9, .y = 7}));
  EXPECT_EQ(*set->read({.zoom = 3, .x = 9, .y = 7}), Bytes{2});
  EXPECT_EQ(*set->stored_bytes({.zoom = 3, .x = 9, .y = 1}), 1);
}

TEST_F(MbtilesSetTest, WhatIsNoBlobIsAnErrorThatNamesTheTile) {
  run_sql(std::string(kPlainTiles) +
          "INSERT INTO tiles VALUES (1, 0, 0, NULL), (1, 1, 0, 7), (1, 2, 0, 2.5);"
          "CREATE TABLE t2 (a, b, c, d); INSERT INTO t2 VALUES (1, 3, 0, 'text');"
          "INSERT INTO tiles SELECT * FROM t2;");
  const auto set = open_mbtiles_set(path());
  ASSERT_EQ(set->keys().size(), 4U);
  for (const TileKey& key : set->keys()) {
    const auto bytes = set->read(key);
    const auto size = set->stored_bytes(key);
    ASSERT_FALSE(bytes.ok());
    ASSERT_FALSE(size.ok());
    EXPECT_EQ(bytes.error().message, "the row of tile " + to_string(key) + " holds no blob");
    EXPECT_EQ(size.error().message, bytes.error().message);
  }
}

TEST_F(MbtilesSetTest, ASetWithoutLayerJsonSaysSoAndCanBeRead) {
  for (const std::string metadata :
       {"", "INSERT INTO metadata VALUES ('name', 'x')",
        "INSERT INTO metadata VALUES ('layer.json', NULL)", "DROP TABLE metadata"}) {
    fs::remove(path());
    run_sql(kPlainTiles + metadata + "; INSERT INTO tiles VALUES (0, 0, 0, x'01')");
    const auto set = open_mbtiles_set(path());
    ASSERT_FALSE(set->layer_text().ok());
    EXPECT_THAT(set->layer_text().error().message,
                HasSubstr(metadata == "DROP TABLE metadata" ? "no such table: metadata"
                                                            : "hold no layer.json"));
    EXPECT_EQ(set->keys().size(), 1U);
  }
}

TEST_F(MbtilesSetTest, WhatIsNoMbtilesFileIsRefused) {
  EXPECT_THAT(refusal(), HasSubstr("there is no such file\n  Check the path"));
  folder_.put("set.mbtiles", "");
  EXPECT_THAT(refusal(), HasSubstr("it is no SQLite file"));
  folder_.put("set.mbtiles", std::string(5000, 'x'));
  EXPECT_THAT(refusal(), HasSubstr("it is no SQLite file"));
  fs::remove(path());
  run_sql("CREATE TABLE photos (x)");
  EXPECT_THAT(refusal(), HasSubstr("no such table: tiles"));
  fs::remove(path());
  run_sql("CREATE TABLE tiles (zoom_level, x, y)");
  EXPECT_THAT(refusal(), HasSubstr("no such column: tile_data"));
  fs::remove(path());
  fs::create_directory(path());
  EXPECT_THAT(refusal(), HasSubstr("it is no SQLite file"));
}

TEST_F(MbtilesSetTest, AViewThatNeverEndsIsRefused) {
  run_sql(
      "CREATE VIEW tiles AS WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n)"
      " SELECT 3 AS zoom_level, i AS tile_column, 0 AS tile_row, x'00' AS tile_data FROM n");
  EXPECT_THAT(refusal(), HasSubstr("more tiles than its bytes can hold"));
}

TEST_F(MbtilesSetTest, ChangesThatAreNotInTheFileYetAreNotPassedOver) {
  const std::string rows = "INSERT INTO tiles VALUES (0, 0, 0, x'01')";
  run_sql(std::string("PRAGMA journal_mode=WAL;") + kPlainTiles);
  {
    // The last connection that closes moves the changes into the file; this copy is of before.
    Result<SqliteFile> writer = SqliteFile::open(path(), SqliteAccess::kWrite, 1U << 20U);
    ASSERT_FALSE(writer->execute(rows));
    fs::copy_file(path(), folder_.path() / "torn.mbtiles");
    fs::copy_file(folder_.path() / "set.mbtiles-wal", folder_.path() / "torn.mbtiles-wal");
    EXPECT_THAT(refusal(), HasSubstr("set.mbtiles-wal holds changes that are not in it yet"));
  }
  // Closed properly: nothing stands beside it, and nothing is put there.
  const auto set = open_mbtiles_set(path());
  EXPECT_EQ(set->keys().size(), 1U);
  EXPECT_FALSE(folder_.has("set.mbtiles-shm"));
  fs::rename(folder_.path() / "torn.mbtiles", path());
  fs::rename(folder_.path() / "torn.mbtiles-wal", folder_.path() / "set.mbtiles-wal");
  EXPECT_THAT(refusal(), HasSubstr("journal_mode=DELETE"));

  fs::remove(path());
  fs::remove(folder_.path() / "set.mbtiles-wal");
  run_sql(kPlainTiles + rows);
  folder_.put("set.mbtiles-journal", std::string("\xd9\xd5\x05\xf9 and so on"));
  EXPECT_THAT(refusal(), HasSubstr("set.mbtiles-journal shows that it is being written"));
  folder_.put("set.mbtiles-journal", std::string(512, '\0'));
  EXPECT_EQ(refusal(), "opened");
}

TEST_F(MbtilesSetTest, ManyThreadsReadWhatIsThere) {
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    for (std::int32_t x = 0; x < 64; ++x) {
      sink->write({.zoom = 6, .x = x, .y = 1}, Bytes(1000, static_cast<std::uint8_t>(x)));
    }
    sink->close("{}");
  }
  const auto set = open_mbtiles_set(path());
  std::vector<std::jthread> threads;
  for (int t = 0; t < 8; ++t) {
    threads.emplace_back([&set] {
      for (int round = 0; round < 20; ++round) {
        for (const TileKey& key : set->keys()) {
          ASSERT_EQ(*set->read(key), Bytes(1000, static_cast<std::uint8_t>(key.x)));
          ASSERT_EQ(*set->stored_bytes(key), 1000);
        }
      }
    });
  }
}

// Whatever is in the file: it is read to its end or refused.
void read_all(const fs::path& path) {
  try {
    for (const RowOrder rows : {RowOrder::kTms, RowOrder::kXyz}) {
      const auto set = open_mbtiles_set(path, rows);
      static_cast<void>(set->layer_text());
      for (const TileKey& key : set->keys()) {
        static_cast<void>(set->read(key));
        static_cast<void>(set->stored_bytes(key));
      }
    }
  } catch (const IoError&) {
    // What a reader is told.
  }
}

TEST_F(MbtilesSetTest, DamageAnywhereEndsInAnErrorAndNeverInACrash) {
  const unsigned seed = std::random_device()();
  std::printf("seed %u\n", seed);
  std::mt19937 random(seed);
  {
    const auto sink = open_mbtiles_sink(path(), Overwrite::kNo);
    for (std::int32_t x = 0; x < 40; ++x) {
      sink->write({.zoom = 5, .x = x, .y = 1},
                  Bytes(static_cast<std::size_t>(x * 300), static_cast<std::uint8_t>(x)));
    }
    sink->close("{\"tiles\": []}");
  }
  const std::string sound = folder_.get("set.mbtiles");
  const std::size_t page = 8192;
  for (int run = 0; run < 400; ++run) {
    std::string damaged = sound;
    const auto flips = 1 + random() % 8;
    for (std::size_t k = 0; k < flips; ++k) {
      // Mostly where SQLite's own numbers are: headers of the file and of pages.
      const std::size_t start = random() % (damaged.size() / page) * page;
      const std::size_t at = start + random() % (random() % 4 == 0 ? page : 120);
      damaged[at] = static_cast<char>(random());
    }
    if (run % 10 == 0) damaged.resize(random() % damaged.size());
    folder_.put("set.mbtiles", damaged);
    read_all(path());
  }
}

}  // namespace
}  // namespace qmpipe
