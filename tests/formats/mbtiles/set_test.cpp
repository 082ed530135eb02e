#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <chrono>
#include <random>
#include <thread>

#include "formats/bytes/errors.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/mbtiles/schema.h"
#include "formats/mbtiles/sqlite_file.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::set_test {
namespace {

using ::testing::AnyOf;
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
          " (1, 4, 0, x'00'), (1, 0, 2, x'00'), (-1, 0, 0, x'00'), (25, 0, 0, x'00'),"
          " (1, -1, 0, x'00'), (9223372036854775807, 0, 0, x'00'), ('a', NULL, 0.5, x'00'),"
          " (0, 0, 0, x'09');");
  const auto set = open_mbtiles_set(path());
  EXPECT_THAT(set->keys(),
              ElementsAre(TileKey{.zoom = 0, .x = 0, .y = 0}, TileKey{.zoom = 2, .x = 1, .y = 0},
                          TileKey{.zoom = 2, .x = 7, .y = 3}));
  EXPECT_THAT(set->strays(), ElementsAre("-1/0/0", "0/0/0 (again)", "1/-1/0", "1/0/2", "1/4/0",
                                         "25/0/0", "9223372036854775807/0/0", "a/NULL/0.5"));
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

// With rows or without any, which no count of rows would notice, and where there is no end to parsing.
TEST_F(MbtilesSetTest, AViewThatNeverEndsIsRefused) {
  const std::string endless = "WITH RECURSIVE n(i) AS (SELECT 0 UNION ALL SELECT i + 1 FROM n) ";
  const std::string columns = "zoom_level, 1 AS tile_column, 0 AS tile_row, x'00' AS tile_data";
  std::string doubled = "CREATE TABLE v0 (zoom_level, tile_column, tile_row, tile_data);";
  for (int k = 0; k < 40; ++k) {
    doubled += "CREATE VIEW v" + std::to_string(k + 1) + " AS SELECT * FROM v" + std::to_string(k) +
               " UNION ALL SELECT * FROM v" + std::to_string(k) + ";";
  }
  for (const std::string& sql :
       {"CREATE VIEW tiles AS " + endless + "SELECT i AS " + columns + " FROM n",
        "CREATE VIEW tiles AS " + endless + "SELECT i AS " + columns + " FROM n WHERE i < 0",
        "CREATE VIEW v AS " + endless + "SELECT i AS " + columns +
            " FROM n WHERE i < 0; CREATE VIEW tiles AS SELECT * FROM v",
        doubled + "CREATE VIEW tiles AS SELECT * FROM v40",
        std::string("CREATE VIEW tiles AS SELECT value AS zoom_level, key AS tile_column, 0 AS "
                    "tile_row, x'00' AS tile_data FROM json_each('[1,2]')"),
        std::string("CREATE TABLE tiles (zoom_level, tile_column, tile_row, tile_data AS "
                    "(hex(zeroblob(9999))))"),
        std::string("CREATE VIRTUAL TABLE tiles USING fts5(zoom_level, tile_column, tile_row, "
                    "tile_data)"),
        std::string(kPlainTiles) + "DROP TABLE metadata; CREATE VIEW metadata AS " + endless +
            "SELECT i AS name, i AS value FROM n WHERE i < 0"}) {
    fs::remove(path());
    run_sql(sql);
    EXPECT_THAT(
        refusal(),
        AnyOf(HasSubstr("does more than pick columns"), HasSubstr("is no table of the file"),
              HasSubstr("is no ordinary table"), HasSubstr("has computed columns")))
        << sql;
  }
}

// A join that any program could have written, of tables that multiply.
TEST_F(MbtilesSetTest, AJoinThatMultipliesEndsSoon) {
  run_sql(
      "CREATE TABLE a (x, z); CREATE TABLE b (y, w, v); CREATE INDEX on_w ON b (w);"
      "WITH n(i) AS (SELECT 5 UNION ALL SELECT i + 1 FROM n WHERE i < 20000)"
      " INSERT INTO a SELECT i, 1 FROM n; INSERT INTO b SELECT x, 1, 1 FROM a;"
      "CREATE VIEW tiles AS SELECT a.x AS zoom_level, a.x AS tile_column, b.y AS tile_row,"
      " b.y AS tile_data FROM a JOIN b ON a.z = b.w AND a.x = b.v");
  // Four hundred million pairs, none of which is a tile.
  const auto start = std::chrono::steady_clock::now();
  EXPECT_THAT(refusal(), HasSubstr("work for longer than its size explains"));
  EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(20));
}

TEST(MbtilesSchema, KnowsTheViewsThatProgramsWrite) {
  const auto tables_in = [](const std::string& sql) {
    const auto tables = tables_of_view(sql);
    return tables ? *tables : std::vector<std::string>{};
  };
  // MBTiles 1.3, planetiler, others.
  EXPECT_THAT(tables_in("CREATE VIEW tiles AS\n    SELECT\n        map.zoom_level AS zoom_level,\n"
                        " map.tile_column AS tile_column, map.tile_row AS tile_row,\n"
                        " images.tile_data AS tile_data\n FROM map\n"
                        " JOIN images ON images.tile_id = map.tile_id;"),
              ElementsAre("map", "images"));
  EXPECT_THAT(tables_in("CREATE VIEW tiles AS select tiles_shallow.zoom_level as zoom_level, "
                        "tiles_data.tile_data as tile_data from tiles_shallow join tiles_data on "
                        "tiles_shallow.tile_data_id = tiles_data.tile_data_id"),
              ElementsAre("tiles_shallow", "tiles_data"));
  EXPECT_THAT(tables_in("CREATE VIEW \"tiles\" AS SELECT m.zoom_level, m.[tile_column], tile_row, "
                        "`i`.tile_data FROM \"map\" AS m LEFT OUTER JOIN images i USING (tile_id)"),
              ElementsAre("map", "images"));
  EXPECT_THAT(tables_in("CREATE VIEW tiles(zoom_level, tile_data) AS SELECT * FROM map, images "
                        "WHERE (map.tile_id == images.tile_id AND map.layer = images.layer)"),
              ElementsAre("map", "images"));
  EXPECT_THAT(tables_in("CREATE VIEW tiles AS SELECT z zoom_level, x AS tile_column FROM t"),
              ElementsAre("t"));
  for (const std::string sql :
       {"CREATE VIEW tiles AS SELECT a FROM t JOIN u ON t.a = u.a JOIN v ON v.a = u.a",
        "CREATE VIEW tiles AS SELECT f(a) FROM t", "CREATE VIEW tiles AS SELECT 1 FROM t",
        "CREATE VIEW tiles AS SELECT a FROM t UNION SELECT a FROM t",
        "CREATE VIEW tiles AS SELECT a FROM (SELECT a FROM t)",
        "CREATE VIEW tiles AS SELECT (SELECT a FROM t) FROM t",
        "CREATE VIEW tiles AS SELECT a FROM main.t", "CREATE VIEW tiles AS VALUES (1)",
        "CREATE VIEW tiles AS SELECT a FROM generate_series(1)",
        "CREATE VIEW tiles AS SELECT a FROM t WHERE a = 1",
        "CREATE VIEW tiles AS SELECT \"a FROM t", "CREATE VIEW tiles AS SELECT a -- x\n FROM t",
        ""}) {
    EXPECT_THAT(tables_in(sql), IsEmpty()) << sql;
  }
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
}  // namespace qmpipe::set_test
