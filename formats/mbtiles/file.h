// The SQLite file that open_mbtiles_sink() fills: tiles in, equal ones once, with transactions that
// leave no trace in the bytes. Knows nothing of the file's final name.
//
// Guarantee: the same calls in the same order make the same pages, whatever was committed when, and
// with any of them left out that another process had committed before it was killed; where a tile or
// the metadata are replaced by others, the content is right, but pages may lie in another order.
// Used by one thread at a time. Everything throws IoError, and nothing works after that: SQLite may
// have rolled back what was not committed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "formats/mbtiles/metadata.h"
#include "formats/mbtiles/sqlite_file.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

class MbtilesFile {
 public:
  // Opens the file or makes it, and keeps every other process out of it. Refuses one that is no
  // working file of a sink.
  explicit MbtilesFile(std::filesystem::path path);

  // Nothing is done when the tile is there with the same bytes.
  void put(const TileKey& key, std::span<const std::uint8_t> bytes);
  bool has(const TileKey& key);
  std::optional<ZoomSpan> zooms();
  // Nothing is done when they are there with the same values.
  void put_metadata(const std::vector<std::pair<std::string, std::string>>& rows);
  // Images that no tile shows any more, because it was replaced.
  void remove_unused_images();
  // What was put so far is on the disk.
  void commit();
  // Whether any tile was committed, now or by another process before.
  bool holds_tiles() const { return committed_images_ > 0; }

 private:
  void make_schema();
  void require_own_schema();
  void read_hashes();
  void begin();
  std::optional<std::int64_t> image_of(const TileKey& key);
  bool image_equals(std::int64_t id, std::span<const std::uint8_t> bytes);
  std::int64_t image_with(std::span<const std::uint8_t> bytes);
  bool has_metadata(const std::vector<std::pair<std::string, std::string>>& rows);

  SqliteStatement prepare(const std::string& sql);
  void execute(const std::string& sql);
  // True when there is a row.
  bool step(SqliteStatement& statement);
  // For a statement without rows.
  void run(SqliteStatement& statement);
  [[noreturn]] void fail(const Error& error);
  void require_usable() const;

  const std::filesystem::path path_;
  SqliteFile file_;
  struct Statements {
    SqliteStatement find_tile;
    SqliteStatement add_tile;
    SqliteStatement move_tile;
    SqliteStatement read_image;
    SqliteStatement add_image;
  };
  std::optional<Statements> statements_;
  // hash64() of an image's bytes to its id. Of images with one hash the first alone is found again.
  std::unordered_map<std::uint64_t, std::int64_t> image_with_hash_;
  std::int64_t last_image_ = 0;
  std::int64_t committed_images_ = 0;
  bool is_in_transaction_ = false;
  std::string failure_;
  std::string failure_remedy_;
};

}  // namespace qmpipe
