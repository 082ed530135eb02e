#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <mutex>
#include <string>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/mbtiles/file.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/mbtiles/set.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

fs::path working_path(const fs::path& path) { return path.string() + kTemporarySuffix; }

// A descriptor of the working file. It must not be closed while SQLite has the file open: that would
// give back SQLite's locks, which belong to the process and not to a descriptor.
class OpenFile {
 public:
  explicit OpenFile(const fs::path& path)
      : path_(path), descriptor_(::open(path.c_str(), O_RDWR | O_CLOEXEC)) {
    if (descriptor_ < 0) throw_io_error("cannot write", path_, errno);
  }
  ~OpenFile() { ::close(descriptor_); }
  OpenFile(const OpenFile&) = delete;
  OpenFile& operator=(const OpenFile&) = delete;

  // The file that has the name is the one that is open.
  bool has_its_name() const {
    struct stat open_one {};
    struct stat named_one {};
    return ::fstat(descriptor_, &open_one) == 0 && ::stat(path_.c_str(), &named_one) == 0 &&
           open_one.st_dev == named_one.st_dev && open_one.st_ino == named_one.st_ino;
  }
  void sync() const {
    if (::fsync(descriptor_) != 0) throw_io_error("cannot write", path_, errno);
  }
  void overwrite(std::span<const std::uint8_t> bytes, std::int64_t offset) const {
    const ssize_t written = ::pwrite(descriptor_, bytes.data(), bytes.size(), offset);
    if (std::cmp_equal(written, bytes.size())) return;
    throw_io_error("cannot write", path_, written < 0 ? errno : EIO);
  }

 private:
  const fs::path path_;
  const int descriptor_;
};

// SQLite counts the transactions in the header, which must not show how many there were. Both of its
// counters must be equal for the header to be believed.
void forget_transactions(const OpenFile& file) {
  constexpr std::int64_t kChangeCounterAt = 24;
  constexpr std::int64_t kVersionValidForAt = 92;
  constexpr std::array<std::uint8_t, 4> kOne = {0, 0, 0, 1};
  file.overwrite(kOne, kChangeCounterAt);
  file.overwrite(kOne, kVersionValidForAt);
}

// The file first: without its journal it might be torn, and must not be found.
void remove_working_file(const fs::path& path) {
  if (fs::exists(working_path(path))) {
    // Not under the feet of a run that is at work. What it holds does not matter.
    Result<SqliteFile> file =
        SqliteFile::open(working_path(path), SqliteAccess::kWrite, kLargestTileBytes);
    if (file && file->execute("BEGIN EXCLUSIVE") && file->is_busy()) {
      throw IoError("cannot write", working_path(path).string(), "another run is at work with it",
                    file->remedy());
    }
  }
  remove_file(working_path(path));
  remove_file(working_path(path).string() + "-journal");
}

class MbtilesSink final : public TileSink {
 public:
  MbtilesSink(fs::path path, std::unique_ptr<TileSet> finished)
      : path_(std::move(path)), finished_(std::move(finished)) {
    if (finished_ == nullptr) start();
  }
  ~MbtilesSink() override {
    const bool is_litter = tiles_ != nullptr && !tiles_->holds_tiles() && file_->has_its_name();
    tiles_.reset();
    if (!is_litter) return;
    ::unlink(working_path(path_).c_str());
    ::unlink((working_path(path_).string() + "-journal").c_str());
  }
  MbtilesSink(const MbtilesSink&) = delete;
  MbtilesSink& operator=(const MbtilesSink&) = delete;

  void write(const TileKey& key, std::span<const std::uint8_t> bytes) override {
    const std::scoped_lock lock(mutex_);
    QMPIPE_CHECK(!is_closed_);
    if (tiles_ == nullptr) {
      // A run that finished the file would have no tile left to write: it is an older one.
      if (is_counted_on_) refuse_finished();
      finished_.reset();
      start();
    }
    tiles_->put(key, bytes);
  }

  void sync() override {
    // Most of what there is to sync, while tiles go on being written.
    if (const OpenFile* const file = file_to_sync_.load()) file->sync();
    const std::scoped_lock lock(mutex_);
    commit();
  }

  bool has(const TileKey& key) const override {
    const std::scoped_lock lock(mutex_);
    if (tiles_ != nullptr) return tiles_->has(key);
    is_counted_on_ = finished_ != nullptr &&
                     std::binary_search(finished_->keys().begin(), finished_->keys().end(), key);
    return is_counted_on_;
  }

  void close(const std::string& layer_json) override {
    const std::scoped_lock lock(mutex_);
    QMPIPE_CHECK(!is_closed_);
    if (finished_ != nullptr) {
      require_finished_with(layer_json);
    } else {
      finish(layer_json);
    }
    is_closed_ = true;
  }

 private:
  void start() {
    tiles_ = std::make_unique<MbtilesFile>(working_path(path_));
    file_ = std::make_unique<OpenFile>(working_path(path_));
    // Else a power cut could take the name away, with what sync() has promised.
    sync_folder_of(working_path(path_));
    file_to_sync_ = file_.get();
  }

  void commit() {
    if (tiles_ == nullptr) return;
    require_own_file();
    tiles_->commit();
  }

  void require_own_file() const {
    if (file_->has_its_name()) return;
    throw IoError("cannot go on with", working_path(path_).string(),
                  "the file was removed or replaced while the run was at work",
                  "Run the same command again; what is missing is built again.");
  }

  void finish(const std::string& layer_json) {
    require_own_file();
    tiles_->remove_unused_images();
    tiles_->put_metadata(mbtiles_metadata(layer_json, tiles_->zooms(), path_.stem().string()));
    tiles_->commit();
    tiles_.reset();
    forget_transactions(*file_);
    file_->sync();
    // Nothing can be rolled back from it any more.
    remove_file(working_path(path_).string() + "-journal");
    if (::rename(working_path(path_).c_str(), path_.c_str()) != 0) {
      throw_io_error("cannot write", path_, errno);
    }
    sync_folder_of(path_);
  }

  // A run was killed after it had finished the file and before it could tell so.
  void require_finished_with(const std::string& layer_json) const {
    const Result<std::string> text = finished_->layer_text();
    if (!text || *text != layer_json) refuse_finished();
  }

  [[noreturn]] void refuse_finished() const {
    throw IoError("cannot go on with", path_.string(),
                  fmt::format("the unfinished {} is gone, and {} is another tile set",
                              working_path(path_).string(), path_.string()),
                  "Run the same command with --overwrite to start over.");
  }

  const fs::path path_;
  mutable std::mutex mutex_;
  // The file at `path_`, as long as it may be what an earlier run has finished.
  std::unique_ptr<TileSet> finished_;
  // It was said of the last tile asked for that it is there: whoever writes others counts on it.
  mutable bool is_counted_on_ = false;
  // Closed in the order: tiles_, file_.
  std::unique_ptr<OpenFile> file_;
  std::unique_ptr<MbtilesFile> tiles_;
  std::atomic<const OpenFile*> file_to_sync_ = nullptr;
  bool is_closed_ = false;
};

// A folder could not be replaced when all is done.
void require_no_folder(const fs::path& path) {
  std::error_code code;
  if (!fs::is_directory(path, code)) return;
  throw IoError("cannot start a tile set in", path.string(), "it is a folder",
                "Choose another name for the file.");
}

void require_absent(const fs::path& path) {
  std::error_code code;
  if (!fs::exists(path, code) && !code) return;
  throw IoError("cannot start a tile set in", path.string(),
                code ? code.message() : "the file is there",
                "Choose another name, or pass --overwrite to replace the file.");
}

}  // namespace

std::unique_ptr<TileSink> open_mbtiles_sink(const fs::path& path, Overwrite overwrite) {
  require_no_folder(path);
  if (overwrite == Overwrite::kNo) require_absent(path);
  if (path.has_parent_path()) make_folders(path.parent_path());
  remove_working_file(path);
  return std::make_unique<MbtilesSink>(path, nullptr);
}

std::unique_ptr<TileSink> resume_mbtiles_sink(const fs::path& path) {
  require_no_folder(path);
  if (path.has_parent_path()) make_folders(path.parent_path());
  std::unique_ptr<TileSet> finished;
  if (!fs::exists(working_path(path)) && fs::exists(path)) {
    // What cannot be read is an older file of some kind, to be replaced.
    auto tile_set = read_mbtiles(path, RowOrder::kTms);
    if (tile_set) finished = std::move(*tile_set);
  }
  return std::make_unique<MbtilesSink>(path, std::move(finished));
}

}  // namespace qmpipe
