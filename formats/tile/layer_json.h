// layer.json, the table of contents of a tile set (quantized-mesh SPECIFICATION of 2026; what
// CesiumJS reads of it: https://github.com/CesiumGS/quantized-mesh).
//
// Guarantees: what write_layer_json() writes, parse_layer_json() reads back equal. The text is a
// pure function of the value: no time, no host.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "scheduler/tile_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// Tiles start_x..end_x, start_y..end_y of one zoom, ends included, y from the south.
struct TileRange {
  std::int32_t start_x = 0;
  std::int32_t start_y = 0;
  std::int32_t end_x = 0;
  std::int32_t end_y = 0;
  friend bool operator==(const TileRange&, const TileRange&) = default;
};

struct LayerJson {
  // Texts are UTF-8; other bytes are written as U+FFFD.
  std::string name;
  std::string description;
  std::string version = "1.0.0";
  std::string attribution;
  Projection projection = Projection::kGeodetic;
  std::vector<std::string> tile_urls = {"{z}/{x}/{y}.terrain?v={version}"};
  std::vector<std::string> extensions;  // "octvertexnormals", "watermask", "metadata"
  std::int32_t min_zoom = 0;
  std::int32_t max_zoom = 0;
  RectangleDeg bounds_deg;
  // available[zoom]; empty list for a zoom without tiles.
  std::vector<std::vector<TileRange>> available;
  // What qmpipe needs to know again to verify or extend the set: JSON text of an object, without
  // blanks (as nlohmann's dump() gives it); written under the key "qmpipe", which clients ignore.
  // Empty in other programs' sets.
  std::string qmpipe_json;
  friend bool operator==(const LayerJson&, const LayerJson&) = default;
};

// Few big rectangles that cover exactly the given keys of one zoom, each key once.
// REQUIRES: keys sorted, all of one zoom, no key twice.
std::vector<TileRange> merge_ranges(std::span<const TileKey> keys);

// The rectangle around the tiles of the deepest zoom. REQUIRES: keys sorted, of the scheme, not
// empty.
RectangleDeg bounds_of_deepest(std::span<const TileKey> keys, const TilingScheme& scheme);

// REQUIRES: finite bounds; qmpipe_json empty or a JSON object.
std::string write_layer_json(const LayerJson& layer);

// What may be the matter with a layer.json that can be read.
enum class LayerFlaw : std::uint8_t {
  kNoTiles,
  kNoVersion,
  kNoFormat,
  kOtherFormat,
  kSchemaForScheme,
  kOtherScheme,
  kNoBounds,
  kBounds,
  kRanges,
  kZooms,
  kNoMaxZoom,
  kDeepestZoom,
  kMetadataLevels,
  kNoAvailability,
  kParentSet,
};

struct LayerComplaint {
  LayerFlaw flaw{};
  std::string text;  // a sentence without a full stop
};

// Tolerant of other programs' sets (unknown keys, missing optional keys, "schema" for "scheme"), so
// that they can be examined; what it had to tolerate is listed in `complaints`. Refuses what is no
// JSON object, has ill-typed known keys, an unknown projection or nests deeper than 64 levels.
// Ranges stand as the file gives them, even reversed or outside the scheme (there is a complaint).
struct ParsedLayerJson {
  LayerJson layer;
  std::string format;
  std::string scheme;
  bool has_max_zoom = false;  // where not, layer.max_zoom is the deepest zoom of `available`
  std::optional<std::int32_t> metadata_availability;
  std::vector<LayerComplaint> complaints;

  bool has(LayerFlaw flaw) const;
};
Result<ParsedLayerJson> parse_layer_json(const std::string& text);

}  // namespace qmpipe
