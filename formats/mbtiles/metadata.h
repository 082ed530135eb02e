// What an MBTiles file says of itself, made from the set's layer.json (MBTiles 1.3, "Metadata").
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace qmpipe {

// The shallowest and deepest zoom that has tiles.
struct ZoomSpan {
  std::int32_t min_zoom = 0;
  std::int32_t max_zoom = 0;
};

// Names and values in the order in which they are stored. A layer.json that cannot be parsed is
// stored like any other, and what would come from it is left out; then, and where it holds no name,
// the set is called `name`. `zooms`: none for a set without tiles.
std::vector<std::pair<std::string, std::string>> mbtiles_metadata(
    const std::string& layer_json, const std::optional<ZoomSpan>& zooms, const std::string& name);

}  // namespace qmpipe
