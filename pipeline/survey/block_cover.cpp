#include "pipeline/survey/block_cover.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace qmpipe {
namespace {

// Where a span begins (1) or ends (-1) on its way east.
struct Edge {
  std::int32_t x = 0;
  std::int32_t change = 0;
};

// What the sources cover, cut where the columns wrap; none twice.
std::vector<BlockSpan> spans_of(const TilingScheme& scheme, std::int32_t zoom,
                                const std::vector<RasterInfo>& sources) {
  const Lattice lattice(scheme, zoom);
  const std::int32_t columns = scheme.columns(zoom);
  std::set<BlockSpan> spans;
  for (const RasterInfo& source : sources) {
    BlockSpan span = covered_span(lattice, source);
    if (span.height == 0) continue;
    span.first_x = (span.first_x % columns + columns) % columns;
    BlockSpan rest = span;
    span.width = std::min(span.width, columns - span.first_x);
    rest.width -= span.width;
    rest.first_x = 0;
    spans.insert(span);
    if (rest.width > 0) spans.insert(rest);
  }
  return {spans.begin(), spans.end()};
}

std::int64_t covered_width(const std::map<std::int32_t, std::int32_t>& changes_by_column) {
  std::int64_t width = 0;
  std::int32_t covering = 0;
  std::int32_t last_x = 0;
  for (const auto& [x, change] : changes_by_column) {
    if (covering > 0) width += x - last_x;
    covering += change;
    last_x = x;
  }
  return width;
}

}  // namespace

BlockSpan covered_span(const Lattice& lattice, const RasterInfo& source) {
  const RectangleDeg& box = source.bounds_deg;
  const auto block = [](double post) {
    return static_cast<std::int32_t>(std::floor(post / kBlockPosts));
  };
  // A post of slack: bounds of projected rasters come from a finite number of edge points.
  BlockSpan span;
  span.first_x = block(lattice.column_at(box.west_deg) - 1);
  span.width = std::min(block(lattice.column_at(box.east_deg) + 1) - span.first_x + 1,
                        lattice.scheme().columns(lattice.zoom()));
  span.first_y = std::max(0, block(lattice.row_at(box.south_deg) - 1));
  const std::int32_t last_y =
      std::min(block_of_post(lattice.rows() - 1), block(lattice.row_at(box.north_deg) + 1));
  span.height = std::max(0, last_y - span.first_y + 1);
  return span;
}

std::vector<BlockKey> covered_blocks(const TilingScheme& scheme, std::int32_t zoom,
                                     const std::vector<RasterInfo>& sources) {
  std::set<BlockKey> blocks;
  for (const BlockSpan& span : spans_of(scheme, zoom, sources)) {
    for (std::int32_t y = span.first_y; y < span.first_y + span.height; ++y) {
      for (std::int32_t x = span.first_x; x < span.first_x + span.width; ++x) {
        blocks.insert({.zoom = zoom, .x = x, .y = y});
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

// Counted, not listed: a zoom may be asked for that has more blocks than any memory holds keys. From
// one row at which spans begin or end to the next, the columns that are covered stay the same.
std::int64_t expected_blocks(const TilingScheme& scheme, std::int32_t zoom,
                             const std::vector<RasterInfo>& sources) {
  std::map<std::int32_t, std::vector<Edge>> edges_by_row;
  for (const BlockSpan& span : spans_of(scheme, zoom, sources)) {
    for (const auto& [y, change] :
         {std::pair(span.first_y, 1), std::pair(span.first_y + span.height, -1)}) {
      edges_by_row[y].push_back({span.first_x, change});
      edges_by_row[y].push_back({span.first_x + span.width, -change});
    }
  }
  std::int64_t blocks = 0;
  std::int64_t width = 0;
  std::int32_t last_y = 0;
  std::map<std::int32_t, std::int32_t> changes_by_column;  // of how many spans cover it
  for (const auto& [y, edges] : edges_by_row) {
    blocks += width * (y - last_y);
    for (const Edge& edge : edges) changes_by_column[edge.x] += edge.change;
    std::erase_if(changes_by_column, [](const auto& one) { return one.second == 0; });
    width = covered_width(changes_by_column);
    last_y = y;
  }
  return blocks;
}

}  // namespace qmpipe
