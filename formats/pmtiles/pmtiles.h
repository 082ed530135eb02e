// A tile set as one file that any store with range requests can serve: PMTiles version 3
// (https://github.com/protomaps/PMTiles/blob/main/spec/v3/spec.md).
//
// Tile ids count along a Hilbert curve over x, y < 2^z, with y from the north; the geodetic grid has
// twice as many columns. So a geodetic tile (z, x, y) stands at (z + 1, x, 2^z - 1 - y): in the upper
// half of the square of the zoom below it, its rows counted from the north within its own 2^z ones.
// No two share an id, a tile's parent stands at the archive's parent, and whoever counts rows from
// the north (as a PMTiles reader does) only adds one to the zoom. A mercator tile (z, x, y) stands at
// (z, x, 2^z - 1 - y).
//
// The metadata say which (`tiling`: "geodetic-z+1" or "mercator") and hold the text of layer.json as
// a string under `layer.json`, beside name, description, attribution, version, type (baselayer) and
// format (application/vnd.quantized-mesh). Tile type 0 (unknown); compression gzip or none, as the
// tiles are.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <vector>

#include "formats/tile/tile_set.h"
#include "formats/tile/tile_sink.h"
#include "scheduler/tile_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// The tile's id in the archive. REQUIRES: a tile of the scheme.
std::uint64_t pmtiles_id(const TileKey& key, Projection projection);

// Sorted as an archive holds them. REQUIRES: tiles of the scheme.
void sort_for_pmtiles(std::vector<TileKey>& keys, Projection projection);

// Tiles go to PATH.qmpipe-tmp, which takes the file's name in close() and is removed when the sink
// is destroyed before. write() REQUIRES keys in the order of sort_for_pmtiles() and tiles that are
// all gzipped or all plain. The archive is clustered: equal tiles are stored once; the root
// directory lies within the first 16 KiB, then come the tiles, the metadata and the leaf
// directories. Throws IoError as the other sinks do, and for what an archive cannot hold: a tile of
// no bytes, no tile at all. Memory: some 80 bytes for each different tile.
std::unique_ptr<TileSink> open_pmtiles_sink(const std::filesystem::path& path, Overwrite overwrite,
                                            Projection projection);

// Reads archives of ours and of other programs (whose tiles are taken to be mercator's, unless the
// metadata hold a layer.json that says otherwise, and to count y from the north). Throws IoError
// when it is no PMTiles 3 file, or when its directories or metadata are damaged: entries that
// overlap, do not ascend or lie outside the file. What no tile of the tiling can stand at is listed
// in strays(), as z/x/y of the archive and the number of tiles that follow.
std::unique_ptr<TileSet> open_pmtiles_set(const std::filesystem::path& path);

}  // namespace qmpipe
