// The finest mesh of a detail-increment model: blocks that share no points, each triangulated alone, and
// the seams that join them into one TIN (Ai et al. 2019, section 2.1).
//
// Guarantees: every triangle is counter-clockwise (exact), no edge belongs to three triangles, no two
// triangles overlap. The result depends on the input alone, so blocks may be made in parallel.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/detail_model/data.h"

namespace qmpipe {

// Points of a block's mesh first; the others have triangles in the seams only, and no level changes
// them.
struct BaseBlock {
  std::vector<DetailPoint> points;
  std::size_t mesh_points = 0;
  std::vector<std::uint32_t> triangles;  // three points each
};

struct DetailBase {
  std::vector<BaseBlock> blocks;
  std::vector<DetailSeam> seams;
};

// How many blocks stand side by side and one above the other.
struct BlockGrid {
  std::int32_t columns = 2;
  std::int32_t rows = 2;
};
// As square as the number allows: 4 is 2 x 2, 6 is 3 x 2. REQUIRES: blocks > 0.
BlockGrid block_grid_of(std::int32_t blocks);

// Points by block, row by row from the south: the bounding box is halved (or cut into as many equal
// parts) along x and y; a point on a cut belongs to the block to the east and north. Within a block
// points come along a space-filling curve. REQUIRES: points within the grid, none at the place of
// another.
std::vector<std::vector<DetailPoint>> split_into_blocks(std::span<const DetailPoint> points,
                                                        const BlockGrid& grid);

// The Delaunay triangulation, out to the convex hull. Fewer than three points, or points on a line,
// have no mesh.
BaseBlock triangulate_block(std::vector<DetailPoint> points);

// The triangles between the blocks' hulls, out to the convex hull of all; a constrained Delaunay
// triangulation of the points on them. REQUIRES: what triangulate_block() made of the parts that
// split_into_blocks() gives.
std::vector<DetailSeam> join_hulls(std::span<const BaseBlock> blocks);

// Heights on a grid of columns x rows posts, row by row from the south; posts that are not valid are
// left out, and so is every cell with less than three valid ones.
struct PostHeights {
  std::int32_t columns = 0;
  std::int32_t rows = 0;
  std::span<const std::int32_t> z;
  std::span<const std::uint8_t> valid;
};

// Two triangles a cell, along the diagonal that rises less. Post (i, j) is the point x = i, y = j;
// columns and rows are cut in the middle like a cloud's box. REQUIRES: at least 2 x 2 posts.
DetailBase grid_base(const PostHeights& posts, const BlockGrid& grid);

// Gives each fan of triangles at a vertex a vertex of its own, where several touch in one; drops points
// without a triangle. `origin[k]`: which point point k was. Triangles keep their places.
void separate_fans(std::vector<DetailPoint>& points, std::vector<std::uint32_t>& triangles,
                   std::vector<std::uint32_t>& origin);

}  // namespace qmpipe
