// A tile as a web server sent it: is it one, can viewers read it, does it fit layer.json, does it lie
// where its address says?
#pragma once

#include <optional>

#include "formats/tile/quantized_mesh.h"
#include "pipeline/web_check/check_answer.h"
#include "pipeline/web_check/check_layer.h"

namespace qmpipe::web_check {

// The tile; none where it cannot be had, and then a finding says why. A status other than 200 is
// the caller's business. Findings of the tile's place are place_of_tile()'s.
std::optional<QuantizedMesh> check_tile_body(const ServedLayer& layer, const TileKey& key,
                                             const HttpAnswer& answer, CheckLog& log);

enum class Whereabouts : std::uint8_t {
  kHere,
  kMirroredRow,  // where the tile of the row as far from the north lies
  kElsewhere
};
// By the header's bounding sphere: its centre must lie within the sphere around the tile's rectangle,
// and not be nearer to the mirrored row's. Tiles that reach around half of the globe (roots,
// and zoom 1 of EPSG:3857) are not told apart.
// REQUIRES: a key in the scheme.
Whereabouts place_of_tile(const TilingScheme& scheme, const TileKey& key,
                          const QuantizedMeshHeader& header);

// The same column, the row as far from the north as the key's is from the south.
TileKey mirrored(const TilingScheme& scheme, const TileKey& key);

}  // namespace qmpipe::web_check
