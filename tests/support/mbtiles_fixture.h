// Tiles for the tests of the MBTiles sink, and a folder to write them to.
#pragma once

#include <gtest/gtest.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <random>
#include <string>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/tile/layer_json.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing {

using Bytes = std::vector<std::uint8_t>;
struct Tile {
  TileKey key;
  Bytes bytes;
};

inline LayerJson example_layer() {
  LayerJson layer;
  layer.name = "Alps";
  layer.description = "A \"description\"";
  layer.attribution = "(c) Survey";
  layer.version = "1.0.0-abc";
  layer.min_zoom = 0;
  layer.max_zoom = 3;
  layer.bounds_deg = {.west_deg = 6, .south_deg = 44.5, .east_deg = 10, .north_deg = 47};
  return layer;
}

inline std::string io_error_of(const std::function<void()>& act) {
  try {
    act();
  } catch (const IoError& error) {
    return error.what();
  }
  return "nothing was thrown";
}

// Rows of one zoom as a build writes them; sizes from nothing to several pages, a third of them
// equal to others.
inline std::vector<Tile> random_tiles(std::int32_t count, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<Tile> tiles;
  for (std::int32_t k = 0; k < count; ++k) {
    const auto pick = random() % 3;
    Bytes bytes;
    if (pick == 0) {
      bytes.assign(random() % 40, static_cast<std::uint8_t>(random() % 5));
    } else {
      bytes.resize(random() % (pick == 1 ? 3000 : 30000));
      for (std::uint8_t& byte : bytes) byte = static_cast<std::uint8_t>(random());
    }
    tiles.push_back({{.zoom = 7, .x = (k * 37) % 250, .y = k / 8 % 100}, std::move(bytes)});
  }
  return tiles;
}

class MbtilesSinkTest : public ::testing::Test {
 protected:
  std::filesystem::path path() const { return folder_.path() / "out.mbtiles"; }
  std::filesystem::path working_path() const { return folder_.path() / "out.mbtiles.qmpipe-tmp"; }
  std::string file_bytes() const { return folder_.get("out.mbtiles"); }

  // One run without any interruption.
  std::string written_at_once(const std::vector<Tile>& tiles) const {
    const auto sink = open_mbtiles_sink(folder_.path() / "once.mbtiles", Overwrite::kYes);
    for (const Tile& tile : tiles) sink->write(tile.key, tile.bytes);
    sink->close(write_layer_json(example_layer()));
    return folder_.get("once.mbtiles");
  }

  const TemporaryFolder folder_;
};

}  // namespace qmpipe::testing
