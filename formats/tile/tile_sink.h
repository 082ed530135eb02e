// Where finished tiles go: a folder, an MBTiles or a PMTiles file, all behind this interface.
//
// Contract: only a close() that did not throw means that the tile set is whole. The destructor is
// best effort. A sink is used by one thread at a time, but sync() may run beside write().
#pragma once

#include <cstdint>
#include <span>
#include <string>

#include "scheduler/tile_key.h"

namespace qmpipe {

// Whether a tile set may take the place of an earlier one.
enum class Overwrite { kNo, kYes };

class TileSink {
 public:
  virtual ~TileSink() = default;
  // Stores a tile's bytes as they are (gzipped or not). Throws IoError.
  virtual void write(const TileKey& key, std::span<const std::uint8_t> bytes) = 0;
  // What was written before the call is on the disk after it. Throws IoError.
  virtual void sync() = 0;
  // True when the sink holds a tile of that key, of this run or of the one it goes on with.
  virtual bool has(const TileKey& key) const = 0;
  // Writes `layer_json`, the text of layer.json, last, so that a set without it is recognisably
  // unfinished. What a file's own metadata need (name, bounds, zooms) is taken from it. Throws
  // IoError.
  virtual void close(const std::string& layer_json) = 0;
};

}  // namespace qmpipe
