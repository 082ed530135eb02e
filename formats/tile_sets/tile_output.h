// A tile set's three forms, told apart by the name of the output: OUT.mbtiles, OUT.pmtiles, else a
// folder.
#pragma once

#include <filesystem>
#include <memory>

#include "formats/tile/tile_sink.h"

namespace qmpipe {

enum class TileForm { kFolder, kMbtiles, kPmtiles };

// By the extension, in capitals too.
TileForm form_of(const std::filesystem::path& output);

// open_folder_sink() or open_mbtiles_sink(). A PMTiles file is refused with a UsageError that names
// the way: its tiles must come in an order that no build keeps, so it is packed from a finished set.
std::unique_ptr<TileSink> open_tile_sink(const std::filesystem::path& output, Overwrite overwrite);

// Goes on with what an earlier run left unfinished, in either form.
std::unique_ptr<TileSink> resume_tile_sink(const std::filesystem::path& output);

// False when the output is absent, or an empty folder, or has no working file: a run that failed has
// left nothing that stands in the way of another. True when that cannot be told.
bool may_hold_tiles(const std::filesystem::path& output);

// Where a build's report goes: report.json in the folder, OUT.mbtiles.report.json beside a file.
std::filesystem::path report_path(const std::filesystem::path& output);

}  // namespace qmpipe
