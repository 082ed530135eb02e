// Cracks between neighbours: what two tiles say about their common side: the second
// promise of docs/decisions/0010-what-verify-promises.md.
//
// A tile's borders are kept without its mesh: a few bytes for each vertex on a side. They are taken
// from the vertices themselves, not from the side lists, because the vertices are what is drawn.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "pipeline/common/finding.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe::verify {

// A border vertex as the file has it; `along` is v on the west and east sides, else u.
struct BorderVertex {
  std::uint16_t along = 0;
  std::uint16_t h = 0;
  OctNormal normal{};
};

struct TileBorders {
  float min_height_m = 0;
  float max_height_m = 0;
  bool has_normals = false;
  // By index_of(Side), ascending; of vertices at one place only the first.
  std::array<std::vector<BorderVertex>, 4> sides;
};

TileBorders borders_of(const QuantizedMesh& mesh);

// Neighbouring surfaces may be this far apart.
inline constexpr double kLargestCrackM = 1e-3;

struct BorderComparison {
  // The largest distance between the two border polylines, in ECEF, measured at every vertex of
  // either; 0 when a border has no vertices.
  double crack_m = 0;
  // With the key of `tile`. Different vertices are one finding that tells the crack too; only equal
  // vertices that are more than kLargestCrackM apart are a kCrack.
  std::vector<Finding> findings;
};

// Compares the `side` of a tile with the opposite side of its neighbour there.
// REQUIRES: neighbour_key is the scheme's neighbour (maybe the tile itself); finite heights.
BorderComparison compare_borders(const TilingScheme& scheme, const TileKey& key,
                                 const TileBorders& tile, Side side, const TileKey& neighbour_key,
                                 const TileBorders& neighbour);

}  // namespace qmpipe::verify
