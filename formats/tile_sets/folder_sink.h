// A tile set as a folder: {z}/{x}/{y}.terrain and layer.json, ready for any static server.
// Every file is written under a temporary name and renamed, so a file that has its name is whole.
// close() syncs the tiles to disk before it writes layer.json; on return that is on the disk too.
// A folder that is removed or replaced while the sink is open is noticed: by the next tile in a new
// column, by sync() and by close(), which throw IoError.
#pragma once

#include <filesystem>
#include <memory>

#include "formats/bytes/file_bytes.h"
#include "formats/tile/tile_sink.h"

namespace qmpipe {

// Creates the folder (and its parents). Throws IoError when it cannot be written to, or when it
// holds anything and `overwrite` is kNo; with kYes an earlier tile set in it is removed first:
// layer.json, report.json, the tiles in numbered zoom folders, files left by an interrupted write,
// and the folders this empties. Nothing else is touched.
std::unique_ptr<TileSink> open_folder_sink(const std::filesystem::path& folder,
                                           Overwrite overwrite);

// Goes on with a tile set that an earlier run left unfinished: what the folder holds stays, and a
// tile that is written again replaces the older one. The folder is made when it is gone. Throws
// IoError when it cannot be written to.
std::unique_ptr<TileSink> resume_folder_sink(const std::filesystem::path& folder);

}  // namespace qmpipe
