// Reading a finished tile set back, ours or another program's: which of its forms it has.
#pragma once

#include <filesystem>
#include <memory>

#include "formats/tile/tile_set.h"

namespace qmpipe {

// `path`: the set's folder, the layer.json in it, or a file that holds the set (told by its
// extension, else by its first bytes). Throws IoError when it cannot be opened as a tile set: not
// there, no such file, neither a layer.json nor a tile in the folder, or a folder of it that cannot
// be listed.
std::unique_ptr<TileSet> open_tile_set(const std::filesystem::path& path);

// A folder, a layer.json or a file that holds a set, to be told from a single tile's file. Looks no
// further than open_tile_set() does before it decides.
bool is_tile_set(const std::filesystem::path& path);

}  // namespace qmpipe
