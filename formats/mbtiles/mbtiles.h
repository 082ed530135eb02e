// A tile set as one SQLite file: MBTiles 1.3 (https://github.com/mapbox/mbtiles-spec).
//
// Rows count from the south (TMS), as our y does. Equal tiles are stored once: `map` points to
// `images`, and the view `tiles` joins them as the specification has it. metadata holds name,
// format (application/vnd.quantized-mesh), bounds, center, minzoom, maxzoom, attribution,
// description, version, type (baselayer), scheme (tms), the tiling's crs (EPSG:4326 or EPSG:3857)
// and layer.json, whole, under that name.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "formats/tile/row_order.h"
#include "formats/tile/tile_set.h"
#include "formats/tile/tile_sink.h"

namespace qmpipe {

// SQLite's page cache and statements.
inline constexpr std::int64_t kMbtilesSinkBytes = std::int64_t{10} << 20U;
// The hash by which an equal tile is found again.
inline constexpr std::int64_t kMbtilesSinkBytesPerTile = 48;

// Tiles go to PATH.qmpipe-tmp, which takes the file's name in close(): a file that has its name is
// whole. Throws IoError when it cannot be written, or when `path` exists and `overwrite` is kNo;
// with kYes the older file stays until close().
//
// Guarantees: what sync() returned from outlives a kill and a power cut. The same tiles in the same
// order make the same bytes, however often the run was interrupted and wherever sync() was called
// (for one version of SQLite); after a tile was replaced by another, the same tiles, but maybe not the
// same bytes. A tile that is there with the same bytes is not written again. One process at a time has
// a working file; sync() and close() notice when it was removed or replaced. What was written since
// the last sync() is gone when the sink is destroyed without close(), and a working file without
// tiles with it. After an error nothing works.
//
// Memory: kMbtilesSinkBytes, and kMbtilesSinkBytesPerTile for each tile that equals no other.
std::unique_ptr<TileSink> open_mbtiles_sink(const std::filesystem::path& path, Overwrite overwrite);

// Goes on with PATH.qmpipe-tmp, or starts it when it is gone; an older file at `path` stays until
// close(). Where there is no working file, the file at `path` may be what a run finished before it
// was killed: its tiles are taken for there, and close() asks for the same layer.json. A write()
// starts a working file after all, or throws IoError when has() has just said yes. Throws IoError
// when the working file is not ours or damaged.
std::unique_ptr<TileSink> resume_mbtiles_sink(const std::filesystem::path& path);

// Reads any program's MBTiles; layer_text() is the metadata's `layer.json` (or `layer_json`). The
// specification numbers rows as kTms.
// Throws IoError when it is no MBTiles file. A damaged file never crashes the program.
std::unique_ptr<TileSet> open_mbtiles_set(const std::filesystem::path& path,
                                          RowOrder rows = RowOrder::kTms);

}  // namespace qmpipe
