#include "formats/mbtiles/set.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <optional>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/mbtiles/schema.h"
#include "formats/mbtiles/sqlite_file.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

// More readers at a time wait; each has a page cache of its own.
constexpr std::size_t kConnections = 4;
constexpr std::size_t kHeaderBytes = 100;

const char* const kKeysSql = "SELECT zoom_level, tile_column, tile_row FROM tiles";
const char* const kReadSql =
    "SELECT tile_data FROM tiles WHERE zoom_level=?1 AND tile_column=?2 AND tile_row=?3";
// Of a blob, SQLite knows type and length without reading it.
const char* const kSizeSql =
    "SELECT typeof(tile_data), length(tile_data) FROM tiles "
    "WHERE zoom_level=?1 AND tile_column=?2 AND tile_row=?3";

struct Connection {
  SqliteFile file;
  SqliteStatement read;
  SqliteStatement size;
};

struct Opening {
  SqliteAccess access = SqliteAccess::kRead;
  std::uint64_t file_bytes = 0;
};

// Listing a tile takes some thirty instructions and a row of at least eight bytes; a table without
// an index is gone through for each tile.
std::int64_t most_instructions(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAlways = 10'000'000;
  return static_cast<std::int64_t>(kAlways + 8 * std::min(file_bytes, std::uint64_t{1} << 50U));
}

Result<Connection> connect(const fs::path& path, const Opening& opening) {
  Result<SqliteFile> file = SqliteFile::open(path, opening.access, kMostMbtilesValueBytes);
  if (!file) return file.error();
  file->limit_work(most_instructions(opening.file_bytes));
  if (const auto error = fault_of_schema(*file)) return *error;
  Result<SqliteStatement> read = file->prepare(kReadSql);
  if (!read) return read.error();
  Result<SqliteStatement> size = file->prepare(kSizeSql);
  if (!size) return size.error();
  return Connection{.file = std::move(*file), .read = std::move(*read), .size = std::move(*size)};
}

// Connections that were all made when the set was opened, so that a file which takes its name later
// is never mixed with it.
class ConnectionPool {
 public:
  explicit ConnectionPool(std::vector<Connection> connections)
      : connections_(std::move(connections)) {
    for (Connection& connection : connections_) free_.push_back(&connection);
  }

  // Calls `use` with a connection that no other thread has meanwhile.
  template <class Use>
  auto with_one(const Use& use) {
    Connection* const connection = take();
    auto result = use(*connection);
    connection->read.reset();
    connection->size.reset();
    {
      const std::scoped_lock lock(mutex_);
      free_.push_back(connection);
    }
    returned_.notify_one();
    return result;
  }

 private:
  Connection* take() {
    std::unique_lock lock(mutex_);
    returned_.wait(lock, [this] { return !free_.empty(); });
    Connection* const connection = free_.back();
    free_.pop_back();
    return connection;
  }

  std::vector<Connection> connections_;
  std::mutex mutex_;
  std::condition_variable returned_;
  std::vector<Connection*> free_;
};

// A value of a row that is no tile, as a part of its path.
std::string text_of_column(const SqliteStatement& row, int column) {
  constexpr std::size_t kMostShown = 20;
  switch (row.type(column)) {
    case SqliteType::kInteger:
      return std::to_string(row.integer(column));
    case SqliteType::kNull:
      return "NULL";
    default:
      return row.text(column).substr(0, kMostShown);
  }
}

std::int64_t row_of(const TileKey& key, RowOrder rows) {
  return rows == RowOrder::kTms ? key.y : (std::int64_t{1} << key.zoom) - 1 - key.y;
}

std::optional<TileKey> key_of(const SqliteStatement& row, RowOrder rows) {
  for (int column = 0; column < 3; ++column) {
    if (row.type(column) != SqliteType::kInteger) return std::nullopt;
  }
  const std::int64_t zoom = row.integer(0);
  const std::int64_t x = row.integer(1);
  const std::int64_t y = row.integer(2);
  if (zoom < 0 || zoom > kMaxZoom) return std::nullopt;
  // The geodetic scheme is the wider one.
  const std::int64_t height = std::int64_t{1} << zoom;
  if (x < 0 || x >= 2 * height || y < 0 || y >= height) return std::nullopt;
  const std::int64_t from_south = rows == RowOrder::kTms ? y : height - 1 - y;
  return TileKey{.zoom = static_cast<std::int32_t>(zoom),
                 .x = static_cast<std::int32_t>(x),
                 .y = static_cast<std::int32_t>(from_south)};
}

struct Listing {
  std::vector<TileKey> keys;
  std::vector<std::string> strays;
};

Result<Listing> list_tiles(SqliteFile& file, RowOrder rows, std::uint64_t file_bytes) {
  Result<SqliteStatement> row = file.prepare(kKeysSql);
  if (!row) return row.error();
  Listing listing;
  for (std::uint64_t count = 0;; ++count) {
    const Result<bool> has_row = row->step();
    if (!has_row) return has_row.error();
    if (!*has_row) break;
    // Two tables that are joined can make far more rows than they have.
    if (count == file_bytes) return Error{"it lists more tiles than its bytes can hold"};
    if (const std::optional<TileKey> key = key_of(*row, rows)) {
      listing.keys.push_back(*key);
    } else {
      listing.strays.push_back(fmt::format("{}/{}/{}", text_of_column(*row, 0),
                                           text_of_column(*row, 1), text_of_column(*row, 2)));
    }
  }
  std::sort(listing.keys.begin(), listing.keys.end());
  // A table without a unique index may hold a tile twice; nobody knows which one a reader gets.
  const auto first_again = [&](auto from) { return std::adjacent_find(from, listing.keys.end()); };
  for (auto it = first_again(listing.keys.begin()); it != listing.keys.end();
       it = first_again(it + 1)) {
    listing.strays.push_back(to_string(*it) + " (again)");
  }
  listing.keys.erase(std::unique(listing.keys.begin(), listing.keys.end()), listing.keys.end());
  std::sort(listing.strays.begin(), listing.strays.end());
  return listing;
}

// The text of layer.json. An older program wrote it under another name.
Result<std::string> read_layer_text(SqliteFile& file) {
  Result<SqliteStatement> row = file.prepare(
      "SELECT value FROM metadata WHERE name IN ('layer.json', 'layer_json') ORDER BY name");
  if (!row) return row.error();
  const Result<bool> has_row = row->step();
  if (!has_row) return has_row.error();
  const bool is_text =
      *has_row && (row->type(0) == SqliteType::kText || row->type(0) == SqliteType::kBlob);
  if (!is_text) {
    return Error{"its metadata hold no layer.json (no row named `layer.json` or `layer_json`)"};
  }
  return row->text(0);
}

class MbtilesSet final : public TileSet {
 public:
  MbtilesSet(std::vector<Connection> connections, RowOrder rows, Listing listing,
             Result<std::string> layer_text)
      : pool_(std::move(connections)),
        rows_(rows),
        keys_(std::move(listing.keys)),
        strays_(std::move(listing.strays)),
        layer_text_(std::move(layer_text)) {}

  Result<std::string> layer_text() const override { return layer_text_; }
  const std::vector<TileKey>& keys() const override { return keys_; }
  const std::vector<std::string>& strays() const override { return strays_; }

  Result<std::vector<std::uint8_t>> read(const TileKey& key) const override {
    return pool_.with_one([&](Connection& connection) -> Result<std::vector<std::uint8_t>> {
      if (const auto error = find(connection.read, key)) return *error;
      if (connection.read.type(0) != SqliteType::kBlob) return no_blob(key);
      const std::span<const std::uint8_t> bytes = connection.read.bytes(0);
      return std::vector<std::uint8_t>(bytes.begin(), bytes.end());
    });
  }

  Result<std::int64_t> stored_bytes(const TileKey& key) const override {
    return pool_.with_one([&](Connection& connection) -> Result<std::int64_t> {
      if (const auto error = find(connection.size, key)) return *error;
      if (connection.size.text(0) != "blob") return no_blob(key);
      return connection.size.integer(1);
    });
  }

 private:
  std::optional<Error> find(SqliteStatement& statement, const TileKey& key) const {
    statement.bind(1, std::int64_t{key.zoom});
    statement.bind(2, std::int64_t{key.x});
    statement.bind(3, row_of(key, rows_));
    const Result<bool> has_row = statement.step();
    if (!has_row) {
      return Error{fmt::format("cannot read tile {}: {}", to_string(key), has_row.error().message)};
    }
    if (!*has_row) return Error{fmt::format("there is no tile {}", to_string(key))};
    return std::nullopt;
  }
  static Error no_blob(const TileKey& key) {
    return Error{fmt::format("the row of tile {} holds no blob", to_string(key))};
  }

  mutable ConnectionPool pool_;
  const RowOrder rows_;
  std::vector<TileKey> keys_;
  std::vector<std::string> strays_;
  Result<std::string> layer_text_;
};

// A journal that SQLite would roll back: it begins with something else than zeros.
bool is_hot(const fs::path& journal) {
  std::error_code code;
  if (!fs::is_regular_file(journal, code)) return false;
  const auto start = read_file_range(journal, 0, 1);
  return start && start->front() != 0;
}

bool holds_changes(const fs::path& wal) {
  std::error_code code;
  const std::uintmax_t bytes = fs::file_size(wal, code);
  return !code && bytes > 0;
}

// How the file can be read without writing anything and without missing what stands beside it.
Result<Opening> examine(const fs::path& path) {
  constexpr std::string_view kMagic("SQLite format 3\0", 16);
  const auto header = read_file_range(path, 0, kHeaderBytes);
  if (!header || std::memcmp(header->data(), kMagic.data(), kMagic.size()) != 0) {
    return Error{"it is no SQLite file"};
  }
  if (holds_changes(path.string() + "-wal")) {
    return Error{fmt::format(
        "{0}-wal holds changes that are not in it yet: close the program that is at work with it, "
        "or run: sqlite3 '{0}' 'PRAGMA journal_mode=DELETE'",
        path.string())};
  }
  if (is_hot(path.string() + "-journal")) {
    return Error{fmt::format(
        "{0}-journal shows that it is being written, or that its writer was killed: wait for that "
        "program, or roll back what it left undone: sqlite3 '{0}' 'SELECT count(*) FROM tiles'",
        path.string())};
  }
  std::error_code code;
  Opening opening;
  opening.file_bytes = fs::file_size(path, code);
  if (code) return Error{code.message()};
  // In WAL mode an ordinary reader would make files beside it, which a folder may forbid.
  constexpr std::size_t kReadVersionAt = 19;
  constexpr std::uint8_t kWal = 2;
  if ((*header)[kReadVersionAt] == kWal) opening.access = SqliteAccess::kReadFrozen;
  return opening;
}

}  // namespace

Result<std::unique_ptr<TileSet>> read_mbtiles(const fs::path& path, RowOrder rows) {
  const Result<Opening> opening = examine(path);
  if (!opening) return opening.error();
  std::vector<Connection> connections;
  for (std::size_t k = 0; k < kConnections; ++k) {
    Result<Connection> connection = connect(path, *opening);
    if (!connection) return connection.error();
    connections.push_back(std::move(*connection));
  }
  SqliteFile& file = connections.front().file;
  Result<Listing> listing = list_tiles(file, rows, opening->file_bytes);
  if (!listing) return listing.error();
  Result<std::string> layer_text = read_layer_text(file);
  return std::unique_ptr<TileSet>(std::make_unique<MbtilesSet>(
      std::move(connections), rows, std::move(*listing), std::move(layer_text)));
}

std::unique_ptr<TileSet> open_mbtiles_set(const fs::path& path, RowOrder rows) {
  std::error_code code;
  if (!fs::exists(path, code)) {
    throw IoError("cannot open the tile set", path.string(),
                  code ? code.message() : "there is no such file", "Check the path.");
  }
  auto tile_set = read_mbtiles(path, rows);
  if (!tile_set) {
    throw IoError("cannot open the tile set", path.string(),
                  "it cannot be read as MBTiles: " + tile_set.error().message, "");
  }
  return std::move(*tile_set);
}

}  // namespace qmpipe
