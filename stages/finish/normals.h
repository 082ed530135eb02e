// Vertex normals from the lattice, not from a tile's own triangles: both tiles at a border see the
// same posts and so write the same two bytes, which leaves no seam in the light (FORMATS 2.4).
#pragma once

#include <span>
#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "stages/posts/heightfield.h"
#include "stages/surface/tin.h"

namespace qmpipe {

// The unit normal in ECEF of the surface through the post's four neighbours; on a pole row, which
// has none beyond it, straight up. A pure function of the post and its neighbours' heights.
// REQUIRES: the window holds the post's neighbours as far as the lattice has them.
Vec3 lattice_normal(const Lattice& lattice, const WindowHeights& heights, const LatticePost& post);

// One for each of the tile's vertices; for one between posts, the mean of the normals of the four
// around it, weighted by how near they are. REQUIRES: a halo of one post.
std::vector<OctNormal> tile_normals(const TilingScheme& scheme, const TileKey& key,
                                    const PostGrid& grid, const WindowHeights& heights,
                                    std::span<const TinVertex> vertices);

}  // namespace qmpipe
