#include "formats/mbtiles/file.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "formats/bytes/errors.h"
#include "formats/bytes/hash64.h"
#include "formats/mbtiles/schema.h"
#include "formats/tile/tile_set.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Whatever SQLite's defaults are where it was built. Freed pages are overwritten, because what they
// held would depend on what was in memory when. The lock is kept from the first transaction on. Pages
// of 8 KiB waste the least over all: 18 % with tiles of 0.5 to 4 kB, 12 % with 1 to 40 kB, where 4 KiB
// waste 35 % and 7 %, 16 KiB 10 % and 17 %.
const char* const kSettings =
    "PRAGMA page_size=8192; PRAGMA auto_vacuum=NONE; PRAGMA encoding='UTF-8';"
    "PRAGMA secure_delete=ON; PRAGMA journal_mode=DELETE; PRAGMA synchronous=FULL;"
    "PRAGMA locking_mode=EXCLUSIVE; PRAGMA cache_size=-8192; PRAGMA foreign_keys=OFF;";

// Images are only ever appended. The view needs no image to list the tiles.
constexpr std::int64_t kApplicationId =
    0x4D504258;  // "MPBX", as the file(1) database knows MBTiles
const std::array<std::string, 4> kSchema = {
    "CREATE TABLE metadata (name TEXT, value TEXT)",
    "CREATE TABLE map (zoom_level INTEGER, tile_column INTEGER, tile_row INTEGER,"
    " tile_id INTEGER, PRIMARY KEY (zoom_level, tile_column, tile_row)) WITHOUT ROWID",
    "CREATE TABLE images (tile_id INTEGER PRIMARY KEY, content_hash INTEGER, tile_data BLOB)",
    "CREATE VIEW tiles AS SELECT map.zoom_level AS zoom_level, map.tile_column AS tile_column,"
    " map.tile_row AS tile_row, images.tile_data AS tile_data"
    " FROM map LEFT JOIN images ON images.tile_id = map.tile_id"};
static_assert(kApplicationId == 1297105496);

const char* const kWhereKey = " WHERE zoom_level=?1 AND tile_column=?2 AND tile_row=?3";

void bind_key(SqliteStatement& statement, const TileKey& key) {
  statement.bind(1, std::int64_t{key.zoom});
  statement.bind(2, std::int64_t{key.x});
  statement.bind(3, std::int64_t{key.y});
}

SqliteFile open_file(const std::filesystem::path& path) {
  Result<SqliteFile> file = SqliteFile::open(path, SqliteAccess::kWrite, kMostMbtilesValueBytes);
  if (!file) {
    throw IoError("cannot write", path.string(), file.error().message,
                  "Check that its folder is there and can be written to.");
  }
  return std::move(*file);
}

}  // namespace

MbtilesFile::MbtilesFile(std::filesystem::path path)
    : path_(std::move(path)), file_(open_file(path_)) {
  execute(kSettings);
  begin();
  SqliteStatement any = prepare("SELECT 1 FROM sqlite_schema LIMIT 1");
  const bool is_new = !step(any);
  any.reset();
  if (is_new) {
    make_schema();
  } else {
    require_own_schema();
  }
  commit();
  statements_.emplace(
      Statements{.find_tile = prepare(std::string("SELECT tile_id FROM map") + kWhereKey),
                 .add_tile = prepare("INSERT INTO map VALUES (?1, ?2, ?3, ?4)"),
                 .move_tile = prepare(std::string("UPDATE map SET tile_id=?4") + kWhereKey),
                 .read_image = prepare("SELECT tile_data FROM images WHERE tile_id=?1"),
                 .add_image = prepare("INSERT INTO images VALUES (?1, ?2, ?3)")});
  if (!is_new) read_hashes();
}

void MbtilesFile::make_schema() {
  execute("PRAGMA application_id=1297105496");
  for (const std::string& sql : kSchema) execute(sql);
}

void MbtilesFile::require_own_schema() {
  SqliteStatement id = prepare("PRAGMA application_id");
  const bool has_id = step(id) && id.integer(0) == kApplicationId;
  // Word for word: views and computed columns run what a file says.
  SqliteStatement objects = prepare("SELECT sql FROM sqlite_schema ORDER BY rowid");
  std::size_t own = 0;
  while (has_id && own < kSchema.size() && step(objects) && objects.text(0) == kSchema[own]) {
    ++own;
  }
  if (own == kSchema.size() && !step(objects)) return;
  fail(Error{"it is no unfinished tile set of this program; remove it, or pass --overwrite"});
}

// Columns before the blob: the blobs' own pages are not read.
void MbtilesFile::read_hashes() {
  SqliteStatement image = prepare("SELECT tile_id, content_hash FROM images ORDER BY tile_id");
  // Numbers are given one by one, and no image takes less than a byte.
  const auto most = static_cast<std::int64_t>(std::filesystem::file_size(path_));
  while (step(image)) {
    last_image_ = image.integer(0);
    if (last_image_ < 1 || last_image_ > most) {
      fail(Error{
          fmt::format("image {} cannot be; remove the file, or pass --overwrite", last_image_)});
    }
    image_with_hash_.emplace(static_cast<std::uint64_t>(image.integer(1)), last_image_);
  }
  committed_images_ = last_image_;
}

void MbtilesFile::put(const TileKey& key, std::span<const std::uint8_t> bytes) {
  require_usable();
  if (bytes.size() > kLargestTileBytes) {
    fail(Error{fmt::format("tile {} has {} bytes, more than the {} that a tile may have",
                           to_string(key), bytes.size(), kLargestTileBytes)});
  }
  const std::optional<std::int64_t> earlier = image_of(key);
  if (earlier && image_equals(*earlier, bytes)) return;
  begin();
  SqliteStatement& tile = earlier ? statements_->move_tile : statements_->add_tile;
  bind_key(tile, key);
  tile.bind(4, image_with(bytes));
  run(tile);
}

bool MbtilesFile::has(const TileKey& key) {
  require_usable();
  return image_of(key).has_value();
}

std::optional<std::int64_t> MbtilesFile::image_of(const TileKey& key) {
  SqliteStatement& find = statements_->find_tile;
  bind_key(find, key);
  std::optional<std::int64_t> id;
  if (step(find)) id = find.integer(0);
  find.reset();
  return id;
}

bool MbtilesFile::image_equals(std::int64_t id, std::span<const std::uint8_t> bytes) {
  SqliteStatement& read = statements_->read_image;
  read.bind(1, id);
  const bool equals =
      step(read) && read.type(0) == SqliteType::kBlob &&
      std::equal(bytes.begin(), bytes.end(), read.bytes(0).begin(), read.bytes(0).end());
  read.reset();
  return equals;
}

// The id of an image with these bytes, stored now where there is none.
std::int64_t MbtilesFile::image_with(std::span<const std::uint8_t> bytes) {
  const std::uint64_t hash = hash64(bytes, 0);
  const auto known = image_with_hash_.find(hash);
  if (known != image_with_hash_.end() && image_equals(known->second, bytes)) return known->second;
  const std::int64_t id = last_image_ + 1;
  SqliteStatement& add = statements_->add_image;
  add.bind(1, id);
  add.bind(2, static_cast<std::int64_t>(hash));
  add.bind(3, bytes);
  run(add);
  last_image_ = id;
  image_with_hash_.emplace(hash, id);
  return id;
}

std::optional<ZoomSpan> MbtilesFile::zooms() {
  require_usable();
  SqliteStatement shallowest = prepare("SELECT min(zoom_level) FROM map");
  SqliteStatement deepest = prepare("SELECT max(zoom_level) FROM map");
  if (!step(shallowest) || !step(deepest) || shallowest.type(0) != SqliteType::kInteger) {
    return std::nullopt;
  }
  return ZoomSpan{.min_zoom = static_cast<std::int32_t>(shallowest.integer(0)),
                  .max_zoom = static_cast<std::int32_t>(deepest.integer(0))};
}

bool MbtilesFile::has_metadata(const std::vector<std::pair<std::string, std::string>>& rows) {
  SqliteStatement read = prepare("SELECT name, value FROM metadata ORDER BY rowid");
  for (const auto& [name, value] : rows) {
    if (!step(read) || read.text(0) != name || read.text(1) != value) {
      return false;
    }
  }
  return !step(read);
}

void MbtilesFile::put_metadata(const std::vector<std::pair<std::string, std::string>>& rows) {
  require_usable();
  if (has_metadata(rows)) return;
  begin();
  execute("DELETE FROM metadata");
  SqliteStatement add = prepare("INSERT INTO metadata VALUES (?1, ?2)");
  for (const auto& [name, value] : rows) {
    add.bind(1, std::string_view(name));
    add.bind(2, std::string_view(value));
    run(add);
  }
}

void MbtilesFile::remove_unused_images() {
  require_usable();
  // Images are numbered from 1 without gaps.
  std::vector<bool> is_used(static_cast<std::size_t>(last_image_) + 1);
  SqliteStatement used = prepare("SELECT tile_id FROM map");
  while (step(used)) {
    const std::int64_t id = used.integer(0);
    if (id > 0 && id <= last_image_) is_used[static_cast<std::size_t>(id)] = true;
  }
  used.reset();
  SqliteStatement remove = prepare("DELETE FROM images WHERE tile_id=?1");
  for (std::int64_t id = 1; id <= last_image_; ++id) {
    if (is_used[static_cast<std::size_t>(id)]) continue;
    begin();
    remove.bind(1, id);
    run(remove);
  }
}

void MbtilesFile::begin() {
  if (is_in_transaction_) return;
  execute("BEGIN EXCLUSIVE");
  is_in_transaction_ = true;
}

void MbtilesFile::commit() {
  require_usable();
  if (!is_in_transaction_) return;
  execute("COMMIT");
  is_in_transaction_ = false;
  committed_images_ = last_image_;
}

SqliteStatement MbtilesFile::prepare(const std::string& sql) {
  Result<SqliteStatement> statement = file_.prepare(sql);
  if (!statement) fail(statement.error());
  return std::move(*statement);
}

void MbtilesFile::execute(const std::string& sql) {
  if (const auto error = file_.execute(sql)) fail(*error);
}

bool MbtilesFile::step(SqliteStatement& statement) {
  const Result<bool> has_row = statement.step();
  if (!has_row) fail(has_row.error());
  return *has_row;
}

void MbtilesFile::run(SqliteStatement& statement) {
  const bool has_row = step(statement);
  statement.reset();
  QMPIPE_CHECK(!has_row);
}

void MbtilesFile::fail(const Error& error) {
  failure_ = file_.is_busy() ? "another run is at work with it" : error.message;
  failure_remedy_ = file_.remedy();
  throw IoError("cannot write", path_.string(), failure_, failure_remedy_);
}

// Else a commit after an error would seem to keep what SQLite has rolled back.
void MbtilesFile::require_usable() const {
  if (failure_.empty()) return;
  throw IoError("cannot write", path_.string(), "it failed before: " + failure_, failure_remedy_);
}

}  // namespace qmpipe
