// The sharp edges of a terrain as polylines: crests, valley floors, cliffs (Campos et al. 2020,
// section 4.3.1).
//
// Sharpness is judged in scaled coordinates (section 4.4.1): the grid's rectangle and the range of
// heights are one unit each, so it does not depend on the terrain's scale.
#pragma once

#include <cstdint>
#include <vector>

#include "stages/surface/tin.h"

namespace qmpipe {

// Vertices of a TIN in the order in which edges join them; the first is the last again when closed.
using VertexPolyline = std::vector<std::uint32_t>;

struct SharpEdgeOptions {
  // Edges whose triangles' normals are farther apart than this are sharp.
  double angle_deg = 60;
  // Polylines of fewer different vertices are left out.
  std::int32_t least_points = 25;
};

// Guarantees: every sharp edge is in one polyline at most, and in one exactly before the short ones
// are left out; where not exactly two sharp edges meet, polylines end. Polylines come in the order
// of their first vertices, those with ends before the closed ones. Same input, same bits.
std::vector<VertexPolyline> sharp_polylines(const Tin& tin, const SharpEdgeOptions& options);

}  // namespace qmpipe
