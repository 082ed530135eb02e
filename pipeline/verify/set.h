// layer.json against the files: the sixth promise of docs/decisions/0010-what-verify-promises.md.
//
// Guarantees: the listing is compared exactly, in both directions, without walking the listed
// rectangles tile by tile: a layer.json that lists the whole globe at zoom 22 costs no more than the
// files that are there. A tile that is gone is one fault: the one that is nearest to its cause
// (listed without a file, else a missing root, else a missing parent).
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/tile/layer_json.h"
#include "formats/tile/quantized_mesh.h"
#include "formats/tile/tile_set.h"
#include "pipeline/common/finding.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe::verify {

struct CheckedLayer {
  std::optional<ParsedLayerJson> parsed;  // none when layer.json cannot be read
  TilingScheme scheme{Projection::kGeodetic};
  std::vector<Finding> findings;
};

CheckedLayer check_layer(const TileSet& tile_set);

// The set's tiles that the scheme has, sorted; the others become findings.
struct TilesInScheme {
  std::vector<TileKey> keys;
  std::vector<Finding> findings;
};
TilesInScheme tiles_in_scheme(const TileSet& tile_set, const TilingScheme& scheme);

// `available`, roots, parents, maxzoom and strays. REQUIRES: keys sorted and in the scheme.
std::vector<Finding> check_listing(const CheckedLayer& layer, const std::vector<TileKey>& keys,
                                   const std::vector<std::string>& strays);

// How many tiles there are with and without an extension, and the first of either.
struct ExtensionTally {
  std::int64_t with = 0;
  std::int64_t without = 0;
  std::optional<TileKey> first_with;
  std::optional<TileKey> first_without;

  void add(const TileKey& key, bool has_extension);
};

struct ExtensionTallies {
  ExtensionTally normals;
  ExtensionTally water_mask;
  // Of the tiles at zooms 0, n, 2n ... that metadataAvailability n names, and of all others.
  ExtensionTally metadata_due;
  ExtensionTally metadata_elsewhere;
};

struct TileExtensions {
  bool has_normals = false;
  bool has_water_mask = false;
  bool has_metadata = false;
};
TileExtensions extensions_of(const QuantizedMesh& mesh);

// Counts the extensions of one tile that could be read.
void add_tile(const CheckedLayer& layer, const TileKey& key, const TileExtensions& extensions,
              ExtensionTallies& tallies);

// What layer.json says of extensions against what the tiles hold.
std::vector<Finding> check_extensions(const CheckedLayer& layer, const ExtensionTallies& tallies);

}  // namespace qmpipe::verify
