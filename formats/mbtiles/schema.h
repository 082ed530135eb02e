// What an MBTiles file's `tiles` and `metadata` are made of: anybody may have written it, and a view is
// a program that runs when it is read.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/mbtiles/sqlite_file.h"
#include "formats/tile/tile_set.h"

namespace qmpipe {

// The largest value that is read or written: a tile, with room for the row's other columns.
inline constexpr std::size_t kMostMbtilesValueBytes = kLargestTileBytes + 4096;

// The tables that a view reads. Refuses every view that does not pick columns of one table, or of two
// that are joined where columns are equal: what MBTiles 1.3 shows and programs write. `sql` is its
// CREATE VIEW statement as SQLite keeps it.
Result<std::vector<std::string>> tables_of_view(const std::string& sql);

// Refuses `tiles` or `metadata` that are neither an ordinary table nor such a view of ordinary tables;
// one that is not there passes.
std::optional<Error> fault_of_schema(SqliteFile& file);

}  // namespace qmpipe
