// From a TIN to a quantized mesh whose shared vertices decode alike in every tile of the zoom.
//
// A vertex at height k * step is stored as (k - k_min) * m, where m is the largest integer with
// 32767 * step / m >= the tile's height range, and the header says min = k_min * step, which is the
// largest multiple of the sides' step that is not above the lowest vertex, and max = min + 32767 *
// step / m (docs/decisions/0003-height-steps.md). The header's minimum is exact; rounding its
// maximum to float32 moves no vertex by more than 0.5 mm: above 16 km m and k_min are chosen so.
#pragma once

#include "formats/tile/quantized_mesh.h"
#include "stages/surface/tin.h"

namespace qmpipe {

// Header, vertices, triangles and side lists; normals are left empty. Vertices keep the TIN's order.
// REQUIRES: the TIN of a tile, strip_ordered(); its heights are multiples of the inner step, those of
// vertices on sides also of the sides', and their range fits 32767 inner steps.
QuantizedMesh quantize(const PostGrid& grid, const Tin& tin, const HeightSteps& height_steps);

// The height of a vertex as a client decodes it.
double decoded_height_m(const QuantizedMesh& mesh, std::size_t vertex);

// Where a vertex lies on the globe, in ECEF.
Vec3 decoded_position_ecef(const QuantizedMesh& mesh, const RectangleDeg& rectangle,
                           std::size_t vertex);

}  // namespace qmpipe
