#include "scheduler/wavefront.h"

#include <algorithm>
#include <unordered_map>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// The keys of one zoom, in rows.
struct Row {
  std::int32_t y = 0;
  std::span<const TileKey> keys;
};

std::vector<Row> rows_of(std::span<const TileKey> keys) {
  std::vector<Row> rows;
  for (std::size_t first = 0; first < keys.size();) {
    std::size_t end = first;
    while (end < keys.size() && keys[end].y == keys[first].y) ++end;
    rows.push_back({.y = keys[first].y, .keys = keys.subspan(first, end - first)});
    first = end;
  }
  return rows;
}

// Even columns run one ahead of the odd column to their west, whose both neighbours are then done.
// The last odd column of a full row follows its western neighbour; its eastern one is column 0.
void append_row(const Row& row, std::vector<TileKey>& order) {
  std::vector<TileKey> waiting;
  for (const TileKey& key : row.keys) {
    if (key.x % 2 != 0) {
      waiting.push_back(key);
      continue;
    }
    order.push_back(key);
    order.insert(order.end(), waiting.begin(), waiting.end());
    waiting.clear();
  }
  order.insert(order.end(), waiting.begin(), waiting.end());
}

// Even rows run one ahead of the odd row to their south.
void append_zoom(std::span<const TileKey> keys, std::vector<TileKey>& order) {
  const Row* waiting = nullptr;
  const std::vector<Row> rows = rows_of(keys);
  for (const Row& row : rows) {
    if (row.y % 2 != 0) {
      if (waiting != nullptr) append_row(*waiting, order);
      waiting = &row;
      continue;
    }
    append_row(row, order);
    if (waiting != nullptr) append_row(*waiting, order);
    waiting = nullptr;
  }
  if (waiting != nullptr) append_row(*waiting, order);
}

SideRole role_of(const TileKey& key, const TileKey& neighbour) {
  if (key == neighbour) return SideRole::kSelf;
  return colour_of(key) < colour_of(neighbour) ? SideRole::kOwner : SideRole::kHeir;
}

}  // namespace

WavefrontPlan plan_wavefront(const TilingScheme& scheme, std::span<const TileKey> keys) {
  QMPIPE_CHECK(std::is_sorted(keys.begin(), keys.end()));
  QMPIPE_CHECK(std::adjacent_find(keys.begin(), keys.end()) == keys.end());
  std::vector<TileKey> order;
  order.reserve(keys.size());
  for (std::size_t first = 0; first < keys.size();) {
    std::size_t end = first;
    while (end < keys.size() && keys[end].zoom == keys[first].zoom) ++end;
    append_zoom(keys.subspan(first, end - first), order);
    first = end;
  }

  std::unordered_map<TileKey, TileIndex, TileKeyHash> index_of_key;
  index_of_key.reserve(order.size());
  for (std::size_t k = 0; k < order.size(); ++k) {
    index_of_key.emplace(order[k], static_cast<TileIndex>(k));
  }
  WavefrontPlan plan;
  plan.tiles.reserve(order.size());
  for (const TileKey& key : order) {
    PlannedTile tile{.key = key};
    for (const Side side : kSides) {
      const auto neighbour = scheme.neighbour(key, side);
      const auto found = neighbour ? index_of_key.find(*neighbour) : index_of_key.end();
      if (found == index_of_key.end()) continue;
      tile.neighbours[index_of(side)] = found->second;
      tile.roles[index_of(side)] = role_of(key, *neighbour);
      if (tile.roles[index_of(side)] == SideRole::kHeir) ++tile.in_degree;
    }
    plan.tiles.push_back(tile);
  }
  return plan;
}

}  // namespace qmpipe
