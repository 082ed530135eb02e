// Where finished tiles go: a folder here, other archives behind the same interface.
//
// Contract: only a close() that did not throw means that the tile set is whole. The destructor is
// best effort. A sink is used by one thread at a time, but sync() may run beside write().
#pragma once

#include <cstdint>
#include <span>

#include "formats/layer_json.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

class TileSink {
 public:
  virtual ~TileSink() = default;
  // Stores a tile's bytes as they are (gzipped or not). Throws IoError.
  virtual void write(const TileKey& key, std::span<const std::uint8_t> bytes) = 0;
  // What was written before the call is on the disk after it. Throws IoError.
  virtual void sync() = 0;
  // True when the sink holds a tile of that key, of this run or of the one it goes on with.
  virtual bool has(const TileKey& key) const = 0;
  // Writes layer.json last, so that a set without it is recognisably unfinished. Throws IoError.
  virtual void close(const LayerJson& layer) = 0;
};

}  // namespace qmpipe
