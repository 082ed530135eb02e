#include "formats/tile_sets/folder_sink.h"

#include <fcntl.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <optional>
#include <string>
#include <system_error>
#include <unordered_set>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/folders.h"
#include "formats/tile/tile_path.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

bool is_temporary(const fs::path& path) { return path.string().ends_with(kTemporarySuffix); }

// Symbolic links are not followed: what they point to is not ours.
bool is_own_folder(const fs::directory_entry& entry) {
  std::error_code code;
  return entry.symlink_status(code).type() == fs::file_type::directory &&
         parse_tile_number(entry.path().filename().string()).has_value();
}

void remove_tiles_of_column(const fs::path& x_folder) {
  for (const fs::directory_entry& entry : entries_of(x_folder)) {
    const bool is_tile = parse_tile_path(entry.path()).has_value();
    if (is_tile || is_temporary(entry.path())) remove_file(entry.path());
  }
  remove_folder_if_empty(x_folder);
}

void remove_tile_set(const fs::path& folder) {
  for (const char* name : {"layer.json", "report.json"}) remove_file(folder / name);
  for (const fs::directory_entry& entry : entries_of(folder)) {
    if (is_temporary(entry.path())) remove_file(entry.path());
    if (!is_own_folder(entry)) continue;
    for (const fs::directory_entry& x_entry : entries_of(entry.path())) {
      if (is_own_folder(x_entry)) remove_tiles_of_column(x_entry.path());
    }
    remove_folder_if_empty(entry.path());
  }
}

// Also where a file system that allocates late reports a full disk.
void sync_file_system_of(const fs::path& folder) {
  const int descriptor = ::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC);
  const int error = descriptor < 0 || ::syncfs(descriptor) != 0 ? errno : 0;
  if (descriptor >= 0) ::close(descriptor);
  if (error != 0) throw_io_error("cannot sync", folder, error);
}

// What tells a folder from another one of the same name.
struct FolderIdentity {
  dev_t device = 0;
  ino_t number = 0;
  friend bool operator==(const FolderIdentity&, const FolderIdentity&) = default;
};

std::optional<FolderIdentity> identity_of(const fs::path& folder) {
  struct stat status {};
  if (::stat(folder.c_str(), &status) != 0) return std::nullopt;
  return FolderIdentity{.device = status.st_dev, .number = status.st_ino};
}

class FolderSink final : public TileSink {
 public:
  explicit FolderSink(fs::path folder)
      : folder_(std::move(folder)), identity_(identity_of(folder_)) {}

  void write(const TileKey& key, std::span<const std::uint8_t> bytes) override {
    QMPIPE_CHECK(!is_closed_);
    const fs::path path = folder_ / tile_file_name(key);
    const TileKey column = {.zoom = key.zoom, .x = key.x, .y = 0};
    if (!made_columns_.contains(column)) {
      // Else a folder that was removed would come back with the tiles of some columns only.
      require_same_folder();
      make_folders(path.parent_path());
      made_columns_.insert(column);
    }
    write_file_atomically(path, bytes);
  }

  void sync() override {
    require_same_folder();
    sync_file_system_of(folder_);
  }

  bool has(const TileKey& key) const override {
    struct stat status {};
    return ::stat((folder_ / tile_file_name(key)).c_str(), &status) == 0 && S_ISREG(status.st_mode);
  }

  void close(const std::string& layer_json) override {
    QMPIPE_CHECK(!is_closed_);
    sync();
    const std::vector<std::uint8_t> bytes(layer_json.begin(), layer_json.end());
    // Whoever sees that the set is whole may remove what it could be resumed from.
    write_file_durably(folder_ / "layer.json", bytes);
    is_closed_ = true;
  }

 private:
  void require_same_folder() const {
    if (identity_ && identity_of(folder_) == identity_) return;
    throw IoError("cannot go on with", folder_.string(),
                  "the folder was removed or replaced while the run was at work",
                  "Run the same command again; what is missing is built again.");
  }

  const fs::path folder_;
  const std::optional<FolderIdentity> identity_;
  // Keys with y = 0 stand for their x folder.
  std::unordered_set<TileKey, TileKeyHash> made_columns_;
  bool is_closed_ = false;
};

}  // namespace

std::unique_ptr<TileSink> open_folder_sink(const fs::path& folder, Overwrite overwrite) {
  make_folders(folder);
  if (overwrite == Overwrite::kYes) {
    remove_tile_set(folder);
  } else if (!entries_of(folder).empty()) {
    throw IoError("cannot start a tile set in", folder.string(), "the folder is not empty",
                  "Choose another folder, or pass --overwrite to replace the tile set in it.");
  }
  return resume_folder_sink(folder);
}

std::unique_ptr<TileSink> resume_folder_sink(const fs::path& folder) {
  make_folders(folder);
  if (::access(folder.c_str(), W_OK | X_OK) != 0) {
    throw_io_error("cannot write to the folder", folder, errno);
  }
  return std::make_unique<FolderSink>(folder);
}

}  // namespace qmpipe
