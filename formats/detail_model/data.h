// A detail-increment model as data (Ai et al. 2019, section 2.2): what its file holds and its levels are
// made from.
//
// A block is one part of the terrain: its coarsest mesh and what makes it finer, step by step. Level 0 is
// the coarsest; each level has one vertex and two triangles more than the one before it. Points and
// triangles are numbered in that order: the coarsest mesh's first, then the splits' own, so that level l
// has the first coarse_points + l points and the first coarse_triangles + 2 l triangles, and a split
// need not name what it adds.
//
// A split is the inverse of a collapse. It names the first half-edge of a fan: the vertex v it leaves
// is split, and the new vertex u takes over `fan` triangles around v, counter-clockwise from that one,
// the last one ending at the edge from l to v. Two triangles are added: (v, r, u) and (v, u, l), where
// r is the end of the half-edge. Half-edge 3 t + k leaves the k-th vertex of triangle t.
//
// Blocks share no points. Seams are the triangles between them: their corners are on the blocks' rims,
// which no level changes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace qmpipe {

// A point on the integer grid that all points of the model share. Integers make planar tests exact and
// the stored form small; a LAS file brings its grid along, a DEM's columns and rows are one.
struct DetailPoint {
  std::int32_t x = 0;
  std::int32_t y = 0;
  std::int32_t z = 0;
  friend bool operator==(const DetailPoint&, const DetailPoint&) = default;
};

// x and y lie in 0..kDetailGridMax, so that products of differences fit 64 bits.
inline constexpr std::int32_t kDetailGridMax = (std::int32_t{1} << 30) - 1;

// Twice the signed area of abc in the plane: positive when counter-clockwise. Exact.
constexpr std::int64_t plane_orientation(const DetailPoint& a, const DetailPoint& b,
                                         const DetailPoint& c) {
  return std::int64_t{b.x - a.x} * (c.y - a.y) - std::int64_t{b.y - a.y} * (c.x - a.x);
}

// Where the grid lies: coordinate = offset + step * integer, per axis. Steps are positive and, like
// all distances of the model, in metres.
struct DetailFrame {
  std::array<double, 3> offset{};
  std::array<double, 3> step_m = {1, 1, 1};
  friend bool operator==(const DetailFrame&, const DetailFrame&) = default;

  std::array<double, 3> place(const DetailPoint& p) const {
    return {offset[0] + step_m[0] * p.x, offset[1] + step_m[1] * p.y, offset[2] + step_m[2] * p.z};
  }
};

struct DetailSplit {
  std::uint32_t half_edge = 0;
  std::uint32_t fan = 0;
  friend bool operator==(const DetailSplit&, const DetailSplit&) = default;
};

struct DetailBlock {
  std::vector<DetailPoint> points;
  std::vector<std::uint32_t> coarse_triangles;  // three points each, counter-clockwise
  std::vector<DetailSplit> splits;
  // Of each level, levels() + 1 values, metres: the smallest visible object, the root of the mean
  // least quadric error, made to fall (not rise) from level to level.
  std::vector<float> svo_m;

  std::size_t levels() const { return splits.size(); }
  std::size_t coarse_points() const { return points.size() - splits.size(); }
  std::size_t points_at(std::size_t level) const { return coarse_points() + level; }
  std::size_t triangles_at(std::size_t level) const {
    return coarse_triangles.size() / 3 + 2 * level;
  }
  friend bool operator==(const DetailBlock&, const DetailBlock&) = default;
};

// A corner of a seam's triangle.
struct DetailCorner {
  std::uint32_t block = 0;
  std::uint32_t point = 0;  // below the block's coarse_points()
  friend bool operator==(const DetailCorner&, const DetailCorner&) = default;
};
using DetailSeam = std::array<DetailCorner, 3>;  // counter-clockwise

struct DetailModel {
  DetailFrame frame;
  std::string crs_wkt;  // empty: unknown
  // Levels that one increment is merged over (stages/detail_model/increment.h); at least 1.
  std::uint32_t interval = 1;
  std::vector<DetailBlock> blocks;
  std::vector<DetailSeam> seams;
  friend bool operator==(const DetailModel&, const DetailModel&) = default;
};

}  // namespace qmpipe
