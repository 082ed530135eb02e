// The vertical error of a decoded tile against posts of a deeper zoom that lie in it: how far the surface
// is from the source's own posts, and not only from those that the tile was made from, which are their
// means.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "scheduler/lattice.h"
#include "stages/finish/tile_error.h"
#include "stages/surface/delaunay.h"
#include "stages/surface/triangle_scan.h"

namespace qmpipe {

// A decoded tile as planes over its square. const use is safe from several threads.
class TileSurface {
 public:
  // REQUIRES: a mesh that decoded, of that tile.
  TileSurface(const TilingScheme& scheme, const TileKey& key, const QuantizedMesh& mesh);

  // Against the posts of a window of a deeper zoom's lattice: `heights_m` row by row from the south,
  // voids NaN. Posts that no triangle covers are not counted; `worst` is not set, and all errors are
  // those at the posts' exact places.
  // REQUIRES: the window lies in the tile; zoom >= the tile's.
  ErrorSummary error(std::int32_t zoom, const PostWindow& window,
                     std::span<const float> heights_m) const;

 private:
  struct Triangle {
    IntPoint corners[3];
    Plane plane;
  };

  TilingScheme scheme_;
  TileKey key_;
  std::vector<Triangle> triangles_;
};

}  // namespace qmpipe
