// The faults of one tile, looked at alone: the fourth and fifth promise of
// docs/decisions/0010-what-verify-promises.md.
//
// Guarantees: whatever the bytes, it ends with findings and never crashes. At most one finding for
// each kind (and side), which says how many places have the fault and names the first. A fault that
// follows from another one is not reported beside it: what a missing corner does to the triangles'
// cover, or what heights that are no numbers do to the sphere. A tile without a finding
//   - decodes under the strictest reading,
//   - covers its square exactly once with counter-clockwise triangles: areas and edges are judged
//     in integers, without any tolerance,
//   - has its four corners, complete sorted side lists, no vertex twice and none unused,
//   - has a bounding sphere that holds every vertex (within 1 mm, or 1e-9 of the radius), and an
//     occlusion point that is hidden only when every vertex is,
//   - is drawn by CesiumJS from wherever one of its vertices is seen (pipeline/verify/visibility.h).
#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/tile/quantized_mesh.h"
#include "pipeline/common/finding.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe::verify {

// What a wrong occlusion point is in a tile whose header minimum is below zero: clients compute
// their own there, so in another program's tile it is a warning.
enum class OcclusionRule { kAlwaysRight, kRightWhereRead };

struct CheckedTile {
  std::optional<QuantizedMesh> mesh;  // none when the tile cannot be read
  std::vector<Finding> findings;
};

// `stored`: the tile's bytes as TileSet::read() gives them. REQUIRES: the key is in the scheme.
CheckedTile check_tile(const TilingScheme& scheme, const TileKey& key,
                       Result<std::vector<std::uint8_t>> stored, OcclusionRule rule);

// The part that needs no bytes. REQUIRES: a mesh that decoded.
std::vector<Finding> check_mesh(const TilingScheme& scheme, const TileKey& key,
                                const QuantizedMesh& mesh, OcclusionRule rule);

}  // namespace qmpipe::verify
