// Do a tile's triangles cover its square exactly once? Judged in integers, without any tolerance.
//
// Why edges and areas suffice: when every edge inside the square is used once in each direction, the
// edges that are left form closed paths along the square's sides, so all points of the square are
// covered equally often; the areas then say how often.
#pragma once

#include <vector>

#include "formats/tile/quantized_mesh.h"
#include "pipeline/common/finding.h"

namespace qmpipe::verify {

// Clockwise and degenerate triangles, then edges and areas (with clockwise triangles turned round,
// so that a flipped one is one fault and not four). Edges are compared by place, not by vertex
// number. Findings carry no key. REQUIRES: a mesh that decoded.
std::vector<Finding> check_triangles(const QuantizedMesh& mesh);
std::vector<Finding> check_cover(const QuantizedMesh& mesh);

}  // namespace qmpipe::verify
