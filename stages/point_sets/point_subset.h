// Three ways to choose a part of a point set (Campos et al. 2020, section 4.3.2), with the results
// of CGAL's functions of these names.
//
// Guarantees: each point at most once, in ascending order of index; random choices come from the
// seed alone. Pure: same input, same bits.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "stages/surface/geodesy.h"

namespace qmpipe {

using PointIndices = std::vector<std::uint32_t>;

// `kept` of `count` points in random order, every choice about as probable as any other.
// REQUIRES: kept <= count.
PointIndices random_sample(std::size_t count, std::size_t kept, std::uint64_t seed);
// How many points a percentage is, rounded down.
std::size_t share_of(std::size_t count, double percent);

PointIndices random_subset(std::size_t count, double removed_percent, std::uint64_t seed);

// A random point of each cubic cell of the grid through the origin. REQUIRES: cell_size_m > 0.
PointIndices grid_subset(std::span<const Vec3> points, double cell_size_m, std::uint64_t seed);

// Clusters are divided by the plane through their middle across their longest axis until they have
// no more than cluster_size points and their surface variation, the smallest eigenvalue of the
// covariance as a share of the sum, is no larger than given (Pauly, Gross and Kobbelt 2002). Of each
// cluster the point nearest to its middle is kept. REQUIRES: cluster_size >= 1.
PointIndices hierarchy_subset(std::span<const Vec3> points, std::int32_t cluster_size,
                              double surface_variation);

}  // namespace qmpipe
