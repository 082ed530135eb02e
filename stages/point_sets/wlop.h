// Weighted locally optimal projection: draws a sample of points towards the densest part of their
// surroundings and pushes it apart, which smooths and evens out (Huang, Li, Zhang, Ascher and
// Cohen-Or 2009).
//
// On the globe an average of points lies below the surface: some 20 m for a radius of 30 km, 20 km
// for one of 1000 km.
// So each point carries its height beside its position; the heights are averaged with the same
// weights, and after every step each point stands again at its own height. On a plane that is the
// same as averaging positions, and there the results are those of CGAL's function of this name.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/surface/metric_frame.h"

namespace qmpipe {

struct SurfacePoint {
  Vec3 position{};      // in the metric frame, at height_m
  double height_m = 0;  // within the heights of the surroundings, or a little beyond
  friend bool operator==(const SurfacePoint&, const SurfacePoint&) = default;
};

struct WlopOptions {
  double neighbour_radius_m = 0;
  std::int32_t iterations = 0;
};

// Where the points of the sample have gone, in its order. A point without others within the radius
// has not moved at all: it comes back bit for bit. Same input, same bits.
// REQUIRES: radius > 0; `sample` are indices of points.
std::vector<SurfacePoint> wlop(std::span<const SurfacePoint> points,
                               std::span<const std::uint32_t> sample, const MetricFrame& frame,
                               const WlopOptions& options);

}  // namespace qmpipe
