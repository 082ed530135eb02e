// "available" of layer.json: roots, ranges, holes among the parents, maxzoom.
#pragma once

#include <optional>
#include <vector>

#include "formats/tile/layer_json.h"
#include "pipeline/web_check/check_layer.h"

namespace qmpipe::web_check {

// Tells the faults and fills layer.available with the ranges that can be used; a layer that lists
// no tile at all is unusable. Up to kMostRangesCompared ranges, parents are compared exactly.
enum class AvailableKey : std::uint8_t { kAbsent, kPresent };
inline constexpr std::size_t kMostRangesCompared = 10000;
void check_available(ServedLayer& layer, AvailableKey key, const WebAddress& url, CheckLog& log);

// A tile of `child_zoom` - 1 that is a parent of one of `children` and in none of `parents`.
std::optional<TileKey> unlisted_parent(const std::vector<TileRange>& children,
                                       const std::vector<TileRange>& parents,
                                       std::int32_t child_zoom);

}  // namespace qmpipe::web_check
