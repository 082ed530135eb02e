// What reads an MBTiles file, without the exception that open_mbtiles_set() makes of a refusal.
#pragma once

#include <filesystem>
#include <memory>

#include "formats/bytes/result.h"
#include "formats/mbtiles/mbtiles.h"

namespace qmpipe {

// The error's text says why, and what to try where that is not plain; it does not name the path.
Result<std::unique_ptr<TileSet>> read_mbtiles(const std::filesystem::path& path, RowOrder rows);

}  // namespace qmpipe
