// From a TIN to a quantized mesh whose shared vertices decode alike in every tile of the zoom.
//
// A vertex at height k * step is stored as (k - k_min) * m, where m is the largest integer with
// 32767 * step / m >= the tile's height range, and the header says min = k_min * step,
// max = min + 32767 * step / m (DESIGN 5.4). The header's float32 maximum adds at most half a unit
// in its last place: under 0.5 mm below 8 km.
#pragma once

#include "formats/quantized_mesh.h"
#include "stages/tin.h"

namespace qmpipe {

// Header, vertices, triangles and side lists; normals are left empty. Vertices keep the TIN's order.
// REQUIRES: the TIN of a tile, strip_ordered(); its heights are multiples of the step, and their
// range fits 32767 of them.
QuantizedMesh quantize(const PostGrid& grid, const Tin& tin, double height_step_m);

// The height of a vertex as a client decodes it.
double decoded_height_m(const QuantizedMesh& mesh, std::size_t vertex);

// Where a vertex lies on the globe, in ECEF.
Vec3 decoded_position_ecef(const QuantizedMesh& mesh, const RectangleDeg& rectangle,
                           std::size_t vertex);

}  // namespace qmpipe
