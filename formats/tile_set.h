// Reading a finished tile set back, ours or another program's.
// const use is safe from several threads.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "formats/layer_json.h"
#include "formats/result.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

class TileSet {
 public:
  virtual ~TileSet() = default;
  // The text of layer.json, or why it cannot be had.
  virtual Result<std::string> layer_text() const = 0;
  // Every tile that is there, sorted. Files that look like tiles but lie outside any scheme
  // (x or y not a number, zoom above kMaxZoom) are listed in strays().
  virtual const std::vector<TileKey>& keys() const = 0;
  virtual const std::vector<std::string>& strays() const = 0;
  // A tile's bytes as stored (maybe gzipped).
  virtual Result<std::vector<std::uint8_t>> read(const TileKey& key) const = 0;
};

// Throws IoError when the path cannot be opened as a tile set.
std::unique_ptr<TileSet> open_tile_set(const std::filesystem::path& path);

// A tile's bytes without gzip, where there was any; refuses what would exceed 256 MiB.
Result<std::vector<std::uint8_t>> plain_tile_bytes(std::vector<std::uint8_t> stored);

}  // namespace qmpipe
