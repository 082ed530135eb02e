// Is a tile drawn from wherever it can be seen? What CesiumJS makes of a tile's header: it leaves a
// tile, with all below it, out where its occlusion point is behind the horizon.
//
// Source: CesiumJS, EllipsoidalOccluder and the worker that makes a mesh of a tile: where the header's
// minimum height is below zero the client computes a point of its own, along the centre of the header's
// bounding sphere and on an ellipsoid that is smaller by that height, and takes the header's where there
// is none. Cameras below the ellipsoid are not looked at.
#pragma once

#include <optional>
#include <span>

#include "formats/tile/quantized_mesh.h"
#include "scheduler/tiling_scheme.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::verify {

struct HiddenTerrain {
  GeoPoint camera;
  std::size_t vertex = 0;  // one that is seen from there
};

// The first camera that sees a vertex of the tile, but for which the client leaves the tile out: of 125
// over the tile at five heights, and, where the tile is wider than a sixth of the globe, of 370 more all
// around it and just beyond where its sides are on the horizon. None when there is no such camera.
// REQUIRES: the positions of the mesh's vertices; a header whose heights are numbers.
std::optional<HiddenTerrain> hidden_terrain(const QuantizedMeshHeader& header,
                                            const RectangleDeg& rectangle,
                                            std::span<const Vec3> positions_ecef);

}  // namespace qmpipe::verify
