// What the MBTiles sink promises of kills, full disks, other threads and other processes.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <thread>

#include "formats/mbtiles/mbtiles.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/mbtiles_fixture.h"
#include "tests/support/small_disk.h"

namespace qmpipe::testing::resume_test {
namespace {

using ::testing::HasSubstr;
namespace fs = std::filesystem;

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

}  // namespace
}  // namespace qmpipe::testing::resume_test
