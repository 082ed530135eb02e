// A finished tile set as its readers see it, ours or another program's, whatever its form.
// const use is safe from several threads.
#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/tile/layer_json.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

// No tile and no layer.json is read that is larger than this.
inline constexpr std::size_t kLargestTileBytes = std::size_t{256} << 20U;

class TileSet {
 public:
  virtual ~TileSet() = default;
  // The text of layer.json, or why it cannot be had.
  virtual Result<std::string> layer_text() const = 0;
  // Every tile that is there, sorted. What looks like a tile but can be none (x or y not a plain
  // number, outside the geodetic scheme, zoom above kMaxZoom, left by an interrupted write) is
  // listed in strays(), sorted, as paths within the set.
  virtual const std::vector<TileKey>& keys() const = 0;
  virtual const std::vector<std::string>& strays() const = 0;
  // A tile's bytes as stored (maybe gzipped), and their number without reading them.
  virtual Result<std::vector<std::uint8_t>> read(const TileKey& key) const = 0;
  virtual Result<std::int64_t> stored_bytes(const TileKey& key) const = 0;
};

// A tile's bytes without gzip, where there was any; refuses what would exceed 256 MiB.
Result<std::vector<std::uint8_t>> plain_tile_bytes(std::vector<std::uint8_t> stored);

}  // namespace qmpipe
