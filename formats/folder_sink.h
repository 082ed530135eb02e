// A tile set as a folder: {z}/{x}/{y}.terrain and layer.json, ready for any static server.
// Every file is written under a temporary name and renamed, so a file that has its name is whole.
#pragma once

#include <filesystem>
#include <memory>

#include "formats/tile_sink.h"

namespace qmpipe {

enum class Overwrite { kNo, kYes };

// Creates the folder (and its parents). Throws IoError when it cannot be written to, or when it
// holds anything and `overwrite` is kNo; with kYes an earlier tile set in it (layer.json,
// report.json, numbered zoom folders) is removed first, and nothing else.
std::unique_ptr<TileSink> open_folder_sink(const std::filesystem::path& folder,
                                           Overwrite overwrite);

// Writes a whole file under a temporary name in the same folder, then renames it. Throws IoError.
void write_file_atomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);

}  // namespace qmpipe
