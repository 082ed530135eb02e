// How far a tile's surface is from the posts it was made from, as Campos et al. 2020 measure it
// (section 5.2): the symmetric Hausdorff distance in ECEF, sampled at the vertices of each mesh, 1000
// random points on its faces and 1000 on its edges.
//
// The paper says that it compares the two sets of points. Its numbers say otherwise: they stay close
// to the tolerance (54 m at zoom 8, where it is 58.6 m), while 2700 points on a tile of 78 km leave
// gaps of more than a kilometre. They are distances from the points of one mesh to the surface of
// the other. Both are measured here.
// Guarantees: exact for the given points; those are a pure function of the tile's key and meshes.
// Choices that the paper leaves open: points on faces are spread evenly by area in (u, v), points on
// edges by length there (on the reference's edges evenly); the reference is the triangulation of all
// 257 x 257 posts, with each cell's diagonal from south-west to north-east.
#pragma once

#include <span>

#include "formats/tile/quantized_mesh.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

inline constexpr int kRandomPointsOnFaces = 1000;
inline constexpr int kRandomPointsOnEdges = 1000;

struct HausdorffDistances {
  // From the points on each mesh to the other mesh's surface: comparable with the paper's Table 4.
  double to_surfaces_m = 0;
  // Between the two sets of points: what the paper's text says; mostly the width of the gaps.
  double between_points_m = 0;
};

// The larger one of the two directed distances. REQUIRES: neither set is empty; finite points.
double hausdorff_between_points_m(std::span<const Vec3> a, std::span<const Vec3> b);

// Between a decoded tile and the lattice's triangulation. REQUIRES: a triangle; finite heights in
// the header; heights_m of kTilePostCount, row by row from the south, without voids.
HausdorffDistances tile_hausdorff(const TilingScheme& scheme, const TileKey& key,
                                  const QuantizedMesh& mesh, std::span<const float> heights_m);

}  // namespace qmpipe
