#include "pipeline/block_cover.h"

#include <algorithm>
#include <cmath>
#include <set>

namespace qmpipe {
BlockSpan covered_span(const Lattice& lattice, const RasterInfo& source) {
  const RectangleDeg& box = source.bounds_deg;
  const auto block = [](double post) {
    return static_cast<std::int32_t>(std::floor(post / kBlockPosts));
  };
  // A post of slack: bounds of projected rasters come from a finite number of edge points.
  BlockSpan span;
  span.first_x = block(lattice.column_at(box.west_deg) - 1);
  span.width = std::min(block(lattice.column_at(box.east_deg) + 1) - span.first_x + 1,
                        lattice.columns() / kBlockPosts);
  span.first_y = std::max(0, block(lattice.row_at(box.south_deg) - 1));
  const std::int32_t last_y =
      std::min((lattice.rows() - 1) / kBlockPosts, block(lattice.row_at(box.north_deg) + 1));
  span.height = std::max(0, last_y - span.first_y + 1);
  return span;
}

std::vector<BlockKey> covered_blocks(const TilingScheme& scheme, std::int32_t zoom,
                                     const std::vector<RasterInfo>& sources) {
  const Lattice lattice(scheme, zoom);
  const std::int32_t columns = scheme.columns(zoom);
  std::set<BlockKey> blocks;
  for (const RasterInfo& source : sources) {
    const BlockSpan span = covered_span(lattice, source);
    for (std::int32_t y = span.first_y; y < span.first_y + span.height; ++y) {
      for (std::int32_t x = span.first_x; x < span.first_x + span.width; ++x) {
        blocks.insert({.zoom = zoom, .x = (x % columns + columns) % columns, .y = y});
      }
    }
  }
  return {blocks.begin(), blocks.end()};
}

std::vector<BlockKey> coarser_blocks(const TilingScheme& scheme,
                                     const std::vector<BlockKey>& blocks) {
  std::set<BlockKey> coarser;
  for (const BlockKey& block : blocks) {
    const std::int32_t zoom = block.zoom - 1;
    for (const std::int32_t y : {block.y / 2, (block.y + 1) / 2}) {
      for (const std::int32_t x : {block.x / 2, (block.x + 1) / 2}) {
        coarser.insert({.zoom = zoom, .x = x % scheme.columns(zoom), .y = y});
      }
    }
  }
  return {coarser.begin(), coarser.end()};
}

std::int64_t expected_blocks(const TilingScheme& scheme, std::int32_t zoom,
                             const std::vector<RasterInfo>& sources) {
  // Counted, not listed: a zoom may be asked for that has more blocks than any memory holds keys.
  const Lattice lattice(scheme, zoom);
  std::int64_t blocks = 0;
  for (const RasterInfo& source : sources) {
    const BlockSpan span = covered_span(lattice, source);
    blocks += static_cast<std::int64_t>(span.width) * span.height;
  }
  return blocks;
}

}  // namespace qmpipe
