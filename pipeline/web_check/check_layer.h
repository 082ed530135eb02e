// layer.json as a viewer would read it from a web server: what it says that viewers stumble over,
// and what follows from it for the tiles' addresses.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/tile/layer_json.h"
#include "formats/tile/row_order.h"
#include "pipeline/web_check/check_finding.h"
#include "pipeline/web_check/web_address.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe::web_check {

struct ServedLayer {
  ParsedLayerJson parsed;
  TilingScheme scheme{Projection::kGeodetic};
  // Of the tiles' addresses; "available" counts from the south in either case.
  RowOrder row_order = RowOrder::kTms;
  // Sound ranges of zooms that viewers ask for, by zoom; empty with metadataAvailability.
  std::vector<std::vector<TileRange>> available;
  // Why no tile can be asked for: a fault was told.
  bool is_usable = true;
  bool has_parent = false;

  bool has_extension(const std::string& name) const;
  bool lists(const TileKey& key) const;
};

// `text`: layer.json's; `url`: its address, for the findings. Findings go to the log; what cannot
// be read at all gives an unusable layer.
ServedLayer check_layer_text(const std::string& text, const WebAddress& url, CheckLog& log);

// A tile's address, as CesiumJS builds it. REQUIRES: a usable layer, a key in its scheme.
Result<WebAddress> tile_address(const ServedLayer& layer, const WebAddress& folder,
                                const TileKey& key);

}  // namespace qmpipe::web_check
