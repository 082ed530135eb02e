// A tile set in another form: folder, MBTiles, PMTiles, each to each, ours or another program's.
//
// Guarantees: the bytes of each tile stay as they are unless another compression is asked for or
// needed; layer.json stays byte for byte unless a client would stumble over it. The output depends
// on the input and the options alone, not on threads. What ends the run leaves no unfinished file.
// Memory does not grow with the set beyond its keys (and what a PMTiles sink keeps).
#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "formats/tile/tile_set.h"
#include "formats/tile_sets/tile_output.h"
#include "pipeline/run/progress.h"

namespace qmpipe {

// Of the tiles as stored.
enum class Packing { kKeep, kPlain, kGzip };

struct ConvertOptions {
  // Its name says the form.
  std::filesystem::path output = {};
  Overwrite overwrite = Overwrite::kNo;
  // DEFAULT: kKeep; a PMTiles archive has one compression for all, so that plain tiles among gzipped
  // ones are gzipped there, at level 7.
  Packing packing = Packing::kKeep;
  // For kGzip, 1 (fast) .. 12 (small).
  int gzip_level = 7;
  std::int32_t threads = 1;
};

struct ConvertReport {
  std::int64_t tiles = 0;
  std::int64_t read_bytes = 0;
  std::int64_t written_bytes = 0;
  // Tiles whose bytes were changed.
  std::int64_t repacked_tiles = 0;
  std::int64_t strays = 0;
  // What was noticed and changed, in sentences without full stops; told by progress too.
  std::vector<std::string> notes;
};

// Throws IoError for a tile that cannot be read (the first in order, by its name), for one outside
// the tiling that layer.json names, for a set without tiles and for what the sinks refuse;
// Interrupted when asked to stop.
ConvertReport convert(const TileSet& input, const ConvertOptions& options, Progress& progress);

}  // namespace qmpipe
