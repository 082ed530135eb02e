// Edge collapse by quadric errors to end points, with a record of every collapse: the simplification
// of the detail-increment model (Ai et al. 2019, section 2.1; Garland and Heckbert 1997).
//
// A vertex goes to that neighbour v at which the sum of its own quadric and v's is least; a vertex's
// quadric is the sum of the squared distances, in square metres, to the planes of its triangles and of
// those of the vertices that went to it. The vertex whose least error is least goes first. Vertices on
// the surface's rim never go, so blocks that share none stay joined.
//
// Guarantees: every state is a surface without folds seen from above (each triangle counter-clockwise,
// exact) of the same topology; equal errors go by vertex number, so the record depends on the input
// alone.
#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "formats/detail_model/data.h"
#include "stages/edge_collapse/collapse_mesh.h"

namespace qmpipe {

// One collapse: `removed` goes to `kept`. Numbers are those of the points and triangles given.
struct DetailCollapse {
  CollapseMesh::Index removed = 0;
  CollapseMesh::Index kept = 0;
  CollapseMesh::Index half_edge = 0;  // from `removed` to the vertex kept
  CollapseMesh::Index twin = 0;       // the same edge in the triangle on its other side
  // The first of the half-edges that leave `removed` in triangles that stay, and how many they are,
  // counter-clockwise.
  CollapseMesh::Index first_of_fan = 0;
  CollapseMesh::Index fan = 0;
  // The mean of the least errors of all vertices that may still go, before the collapse (MMQE), as it
  // is; square metres.
  double mean_least_error_m2 = 0;
};

struct DetailRecord {
  std::vector<DetailCollapse> collapses;
  // After the last of them.
  double mean_least_error_m2 = 0;
};

// Until `target_triangles` are left or no vertex may go. `tick` is told every few thousand collapses how
// many there were since it was last called; what it throws ends the work. REQUIRES: triangles as CollapseMesh takes
// them, counter-clockwise in the plane; points within the grid.
DetailRecord simplify_by_quadrics(std::span<const DetailPoint> points,
                                  std::span<const std::uint32_t> triangles,
                                  const DetailFrame& frame, std::int64_t target_triangles,
                                  const std::function<void(std::int64_t)>& tick = {});

}  // namespace qmpipe
