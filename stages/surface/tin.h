// The surface of one tile (or one DEM) between simplification and quantization.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "scheduler/border.h"
#include "stages/posts/height_step.h"
#include "stages/posts/post_grid.h"

namespace qmpipe {

inline constexpr std::int32_t kNoPost = -1;

struct TinVertex {
  // In the quantized frame of the grid.
  std::int32_t u = 0;
  std::int32_t v = 0;
  // The post that this vertex is, or kNoPost for one that a method has put between posts. Vertices
  // on the sides are always posts.
  std::int32_t post = kNoPost;
  // A multiple of the tile's height step (stages/posts/height_step.h); on a side of the zoom's, so
  // that neighbours decode common vertices alike.
  double height_m = 0;
  friend bool operator==(const TinVertex&, const TinVertex&) = default;
};

struct Tin {
  std::vector<TinVertex> vertices;
  // Three vertices for each triangle, counter-clockwise in (u, v).
  std::vector<std::uint32_t> indices;

  std::size_t triangle_count() const { return indices.size() / 3; }
};

// By index_of(Side): the vertices that a side must have, or none where this tile decides.
using FixedBorders = std::array<std::optional<BorderMask>, 4>;

// The vertex that a post is: its height on a step, the sides' or the inner one.
TinVertex vertex_at_post(const PostGrid& grid, std::int32_t post, float height_m,
                         const HeightSteps& height_steps);

// The post whose rounded place this is, or kNoPost.
std::int32_t post_at(const PostGrid& grid, std::int32_t u, std::int32_t v);

// The vertices on one side of a tile. REQUIRES: the TIN of a tile.
BorderMask border_of(const Tin& tin, Side side);

}  // namespace qmpipe
