#include "formats/tile_sets/folder_sink.h"
#include "formats/tile/layer_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mount.h>
#include <unistd.h>

#include <thread>

#include "formats/bytes/errors.h"
#include "tests/support/file_size_limit.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::folder_sink_test {
namespace {

using testing::FileSizeLimit;
using ::testing::HasSubstr;
using testing::TemporaryFolder;
using Bytes = std::vector<std::uint8_t>;

template <class Action>
std::string io_error_of(const Action& action) {
  try {
    action();
  } catch (const IoError& error) {
    return error.what();
  }
  return "no IoError";
}

TEST(FolderSink, TilesAndLayerStandWhereServersLookForThem) {
  const TemporaryFolder folder;
  const auto sink = open_folder_sink(folder.path() / "deep" / "out", Overwrite::kNo);
  sink->write({.zoom = 0, .x = 1, .y = 0}, Bytes{1, 2, 3});
  sink->write({.zoom = 12, .x = 4000, .y = 77}, Bytes{});
  sink->write({.zoom = 12, .x = 4000, .y = 78}, Bytes{9});
  EXPECT_FALSE(folder.has("deep/out/layer.json"));
  LayerJson layer;
  layer.name = "trial";
  sink->close(write_layer_json(layer));
  EXPECT_EQ(folder.get("deep/out/0/1/0.terrain"), "\x01\x02\x03");
  EXPECT_EQ(folder.get("deep/out/12/4000/78.terrain"), "\x09");
  EXPECT_TRUE(folder.has("deep/out/12/4000/77.terrain"));
  EXPECT_EQ(folder.get("deep/out/layer.json"), write_layer_json(layer));
}

TEST(FolderSink, AFolderThatHoldsAnythingIsRefused) {
  const TemporaryFolder folder;
  folder.put("notes.txt", "mine");
  EXPECT_THAT(io_error_of([&] { open_folder_sink(folder.path(), Overwrite::kNo); }),
              HasSubstr("the folder is not empty\n  Choose another folder, or pass --overwrite"));
}

TEST(FolderSink, AResumedSetKeepsWhatItHasAndTakesTilesAgain) {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder.path() / "out";
  const TileKey first = {.zoom = 1, .x = 0, .y = 0};
  const TileKey second = {.zoom = 1, .x = 0, .y = 1};
  {
    const auto sink = open_folder_sink(out, Overwrite::kNo);
    sink->write(first, Bytes{1});
    sink->write(second, Bytes{2});
    sink->sync();
  }
  folder.put("out/1/0/1.terrain.qmpipe-tmp", "torn");
  const auto sink = resume_folder_sink(out);
  EXPECT_TRUE(sink->has(first));
  EXPECT_FALSE(sink->has({.zoom = 1, .x = 1, .y = 1}));
  sink->write(second, Bytes{3});
  sink->close(write_layer_json(LayerJson()));
  EXPECT_EQ(folder.get("out/1/0/0.terrain"), "\x01");
  EXPECT_EQ(folder.get("out/1/0/1.terrain"), "\x03");
  EXPECT_FALSE(folder.has("out/1/0/1.terrain.qmpipe-tmp"));
}

TEST(FolderSink, AFolderThatIsTakenAwayIsNoticed) {
  const TemporaryFolder folder;
  const std::filesystem::path out = folder.path() / "out";
  const auto sink = open_folder_sink(out, Overwrite::kNo);
  sink->write({.zoom = 1, .x = 0, .y = 0}, Bytes{1});
  std::filesystem::rename(out, folder.path() / "moved");
  // Another one of the same name is not the same.
  std::filesystem::create_directories(out);
  EXPECT_THAT(io_error_of([&] { sink->write({.zoom = 1, .x = 1, .y = 0}, Bytes{1}); }),
              HasSubstr("removed or replaced"));
  EXPECT_THAT(io_error_of([&] { sink->sync(); }), HasSubstr("removed or replaced"));
  EXPECT_THAT(io_error_of([&] { sink->close(write_layer_json(LayerJson())); }),
              HasSubstr("removed or replaced"));
  EXPECT_TRUE(std::filesystem::is_empty(out));
}

TEST(FolderSink, OverwriteRemovesATileSetAndNothingElse) {
  const TemporaryFolder folder;
  const std::vector<std::string> ours = {
      "layer.json",    "report.json",    "layer.json.qmpipe-tmp",     "0/0/0.terrain",
      "0/1/0.terrain", "14/9/9.terrain", "14/9/10.terrain.qmpipe-tmp"};
  const std::vector<std::string> theirs = {"notes.txt",       "0/readme.txt",       "3/4/photo.jpg",
                                           "007/0/1.terrain", "viewer/1/2.terrain", "2024",
                                           "14/9/x.terrain"};
  for (const std::string& name : ours) folder.put(name, "x");
  for (const std::string& name : theirs) folder.put(name, "x");
  const TemporaryFolder elsewhere;
  elsewhere.put("1/1.terrain", "x");
  std::filesystem::create_directory_symlink(elsewhere.path(), folder.path() / "5");

  const auto sink = open_folder_sink(folder.path(), Overwrite::kYes);
  for (const std::string& name : ours) EXPECT_FALSE(folder.has(name)) << name;
  for (const std::string& name : theirs) EXPECT_TRUE(folder.has(name)) << name;
  EXPECT_FALSE(folder.has("0/0"));
  EXPECT_TRUE(elsewhere.has("1/1.terrain"));
  sink->write({.zoom = 0, .x = 0, .y = 0}, Bytes{1});
  sink->close(write_layer_json(LayerJson()));
}

TEST(FolderSink, APathUnderAFileIsRefusedWithARemedy) {
  const TemporaryFolder folder;
  folder.put("file", "x");
  const std::string message =
      io_error_of([&] { open_folder_sink(folder.path() / "file" / "out", Overwrite::kNo); });
  EXPECT_THAT(message, HasSubstr("file/out: Not a directory\n  A file stands where"));
  EXPECT_THAT(io_error_of([&] { open_folder_sink(folder.path() / "file", Overwrite::kNo); }),
              HasSubstr("A file stands where"));

  const auto sink = open_folder_sink(folder.path() / "out", Overwrite::kNo);
  folder.put("out/3", "a file in the way");
  EXPECT_THAT(io_error_of([&] { sink->write({.zoom = 3, .x = 1, .y = 1}, Bytes{1}); }),
              HasSubstr("out/3/1"));
}

TEST(WriteFileAtomically, AnOlderFileStaysWholeUntilTheNewOneIs) {
  const TemporaryFolder folder;
  const std::filesystem::path path = folder.path() / "tile";
  // Each content is all of one byte; a reader may see either, but never a mixture or a part.
  const std::size_t size = 100000;
  write_file_atomically(path, Bytes(size, 'a'));
  std::jthread writer([&](const std::stop_token& stop) {
    for (int i = 0; !stop.stop_requested(); ++i) {
      write_file_atomically(path, Bytes(size, i % 2 == 0 ? 'b' : 'a'));
    }
  });
  for (int i = 0; i < 100; ++i) {
    const std::string seen = folder.get("tile");
    ASSERT_EQ(seen.size(), size);
    ASSERT_EQ(seen.find_first_not_of(seen[0]), std::string::npos);
  }
}

TEST(WriteFileAtomically, AWriteThatFailsHalfwayLeavesTheOldFileAndNoRest) {
  const TemporaryFolder folder;
  folder.put("tile", "old");
  {
    const FileSizeLimit limit(1000);
    EXPECT_THAT(
        io_error_of([&] { write_file_atomically(folder.path() / "tile", Bytes(5000, 'n')); }),
        HasSubstr("tile: File too large\n  Raise the limit"));
  }
  EXPECT_EQ(folder.get("tile"), "old");
  EXPECT_FALSE(folder.has("tile.qmpipe-tmp"));
}

TEST(FolderSink, AFullDiskIsToldWithARemedyAndLeavesWholeTilesOnly) {
  const TemporaryFolder folder;
  const std::string mount_point = folder.path().string();
  if (::mount("tmpfs", mount_point.c_str(), "tmpfs", 0, "size=256k") != 0) {
    GTEST_SKIP() << "no right to mount a small disk here";
  }
  std::string message = "never full";
  std::int32_t written = 0;
  {
    const auto sink = open_folder_sink(folder.path() / "out", Overwrite::kNo);
    message = io_error_of([&] {
      for (; written < 1000; ++written) {
        sink->write({.zoom = 10, .x = 0, .y = written}, Bytes(3000, 'x'));
      }
    });
  }
  std::size_t whole = 0;
  for (const auto& entry : std::filesystem::directory_iterator(folder.path() / "out/10/0")) {
    EXPECT_EQ(entry.path().extension(), ".terrain");
    EXPECT_EQ(entry.file_size(), 3000U);
    ++whole;
  }
  EXPECT_EQ(::umount(mount_point.c_str()), 0);
  EXPECT_EQ(whole, static_cast<std::size_t>(written));
  EXPECT_THAT(message, HasSubstr("No space left on device\n  Free some space"));
}

}  // namespace
}  // namespace qmpipe::folder_sink_test
