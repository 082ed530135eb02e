#include "formats/tile_sets/open_tile_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <string_view>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/pmtiles/pmtiles.h"
#include "formats/tile/tile_path.h"
#include "formats/tile_sets/tile_output.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

const char* const kPathRemedy =
    "Name the folder that holds layer.json, or the file of a packed set.";

bool is_all_digits(const std::string& text) {
  return !text.empty() && std::all_of(text.begin(), text.end(),
                                      [](unsigned char c) { return std::isdigit(c) != 0; });
}

bool looks_like_tile(const fs::path& path) {
  const std::string name = path.filename().string();
  return name.ends_with(kTileExtension) ||
         name.ends_with(std::string(kTileExtension) + kTemporarySuffix);
}

// The geodetic scheme is the wider one.
bool is_in_some_scheme(const TileKey& key) {
  return key.zoom <= kMaxZoom && TilingScheme(Projection::kGeodetic).contains(key);
}

class Scanner {
 public:
  explicit Scanner(fs::path folder) : folder_(std::move(folder)) {}

  // Three levels deep at most, so that links in a circle do no harm.
  void run() {
    for_each_entry(folder_, [this](const fs::directory_entry& entry) {
      if (is_folder(entry) && is_all_digits(entry.path().filename().string())) {
        scan_zoom(entry.path());
      } else {
        note_stray(entry);
      }
    });
    std::sort(keys.begin(), keys.end());
    std::sort(strays.begin(), strays.end());
  }

  std::vector<TileKey> keys;
  std::vector<std::string> strays;

 private:
  template <class Visit>
  static void for_each_entry(const fs::path& folder, const Visit& visit) {
    std::error_code code;
    for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
      visit(*it);
    }
    if (code) {
      throw IoError("cannot list the folder", folder.string(), code.message(),
                    remedy_for_errno(code.value()));
    }
  }

  static bool is_folder(const fs::directory_entry& entry) {
    std::error_code code;
    return entry.is_directory(code);
  }

  void scan_zoom(const fs::path& zoom_folder) {
    for_each_entry(zoom_folder, [this](const fs::directory_entry& entry) {
      if (is_folder(entry)) {
        for_each_entry(entry.path(), [this](const fs::directory_entry& e) { scan_tile(e); });
      } else {
        note_stray(entry);
      }
    });
  }

  void scan_tile(const fs::directory_entry& entry) {
    std::error_code code;
    const std::optional<TileKey> key = parse_tile_path(entry.path());
    if (key && is_in_some_scheme(*key) && entry.is_regular_file(code)) {
      keys.push_back(*key);
    } else {
      note_stray(entry);
    }
  }

  void note_stray(const fs::directory_entry& entry) {
    if (looks_like_tile(entry.path())) {
      strays.push_back(entry.path().lexically_relative(folder_).generic_string());
    }
  }

  fs::path folder_;
};

class FolderTileSet final : public TileSet {
 public:
  explicit FolderTileSet(fs::path folder) : folder_(std::move(folder)) {
    Scanner scanner(folder_);
    scanner.run();
    keys_ = std::move(scanner.keys);
    strays_ = std::move(scanner.strays);
  }

  Result<std::string> layer_text() const override {
    const auto bytes = read_file_bytes(folder_ / "layer.json", kLargestTileBytes);
    if (!bytes) return bytes.error();
    return std::string(bytes->begin(), bytes->end());
  }
  const std::vector<TileKey>& keys() const override { return keys_; }
  const std::vector<std::string>& strays() const override { return strays_; }

  Result<std::vector<std::uint8_t>> read(const TileKey& key) const override {
    return read_file_bytes(folder_ / tile_file_name(key), kLargestTileBytes);
  }
  Result<std::int64_t> stored_bytes(const TileKey& key) const override {
    std::error_code code;
    const fs::path path = folder_ / tile_file_name(key);
    const std::uintmax_t size = fs::file_size(path, code);
    if (code) return Error{fmt::format("cannot read {}: {}", path.string(), code.message())};
    return static_cast<std::int64_t>(size);
  }

 private:
  fs::path folder_;
  std::vector<TileKey> keys_;
  std::vector<std::string> strays_;
};

bool starts_with(const fs::path& path, std::string_view start) {
  const auto bytes = read_file_range(path, 0, start.size());
  return bytes && std::equal(start.begin(), start.end(), bytes->begin());
}

// By its name, else by its first bytes.
TileForm form_of_file(const fs::path& path) {
  const TileForm by_name = form_of(path);
  if (by_name != TileForm::kFolder) return by_name;
  if (starts_with(path, std::string_view("SQLite format 3\0", 16))) return TileForm::kMbtiles;
  if (starts_with(path, "PMTiles")) return TileForm::kPmtiles;
  return TileForm::kFolder;
}

std::unique_ptr<TileSet> open_file_set(const fs::path& path) {
  switch (form_of_file(path)) {
    case TileForm::kMbtiles:
      return open_mbtiles_set(path);
    case TileForm::kPmtiles:
      return open_pmtiles_set(path);
    case TileForm::kFolder:
      break;
  }
  throw IoError("cannot open the tile set", path.string(),
                "it is neither a folder nor an .mbtiles or .pmtiles file", kPathRemedy);
}

std::unique_ptr<TileSet> open_folder_set(const fs::path& folder) {
  std::error_code code;
  auto tile_set = std::make_unique<FolderTileSet>(folder);
  if (tile_set->keys().empty() && !fs::exists(folder / "layer.json", code)) {
    throw IoError("cannot open the tile set", folder.string(),
                  "there is neither a layer.json nor a tile in it", kPathRemedy);
  }
  return tile_set;
}

}  // namespace

bool is_tile_set(const fs::path& path) {
  std::error_code code;
  return fs::is_directory(path, code) || path.filename() == "layer.json" ||
         form_of_file(path) != TileForm::kFolder;
}

std::unique_ptr<TileSet> open_tile_set(const fs::path& path) {
  std::error_code code;
  if (!fs::exists(path, code)) {
    throw IoError("cannot open the tile set", path.string(),
                  code ? code.message() : "there is no such file or folder", "Check the path.");
  }
  if (fs::is_directory(path, code)) return open_folder_set(path);
  if (path.filename() != "layer.json") return open_file_set(path);
  return open_folder_set(path.has_parent_path() ? path.parent_path() : ".");
}

}  // namespace qmpipe
