// A layer.json that fits the tiles that are there: for sets of programs that write none, or a wrong
// one, so that clients can load what can be loaded.
#pragma once

#include <string>
#include <vector>

#include "formats/tile/tile_set.h"

namespace qmpipe {

struct FittedLayer {
  std::string text;
  // What differs from the set's own, in sentences without full stops; empty when the text is the
  // set's own, byte for byte.
  std::vector<std::string> changes;
};

// Keeps the set's layer.json unless a client would stumble over it: no layer.json, or one that is no
// JSON; tiles listed that are not there or there and not listed (unless tiles carry their
// availability: metadataAvailability); no `tiles` template that leads to {z}/{x}/{y}.terrain beside
// layer.json; a scheme that is not tms; maxzoom below the deepest tile; extensions that the tiles
// hold and it does not list. Then those keys are put right and all others stay. Reads a few tiles,
// and no more. `name`: for a set that has none.
FittedLayer fit_layer_json(const TileSet& tile_set, const std::string& name);

}  // namespace qmpipe
