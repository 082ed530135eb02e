#include <algorithm>
#include <map>
#include <utility>

#include "formats/tile/layer_json.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Which way runs are formed first, before equal ones of neighbouring rows (columns) are joined.
enum class Along { kRows, kColumns };

struct Cell {
  std::int32_t line;   // the row, or the column
  std::int32_t place;  // the position in it
};

struct RangeRun {
  std::int32_t first_line;
  std::int32_t last_line;
  std::int32_t first_place;
  std::int32_t last_place;
};

// REQUIRES: cells sorted by line, then place.
std::vector<RangeRun> runs_of(std::span<const Cell> cells) {
  std::vector<RangeRun> runs;
  // Runs that end in the line before or in this one, by their places.
  std::map<std::pair<std::int32_t, std::int32_t>, std::size_t> open_runs;
  std::size_t begin = 0;
  while (begin < cells.size()) {
    std::size_t end = begin + 1;
    while (end < cells.size() && cells[end].line == cells[begin].line &&
           cells[end].place == cells[end - 1].place + 1) {
      ++end;
    }
    const RangeRun run = {.first_line = cells[begin].line,
                          .last_line = cells[begin].line,
                          .first_place = cells[begin].place,
                          .last_place = cells[end - 1].place};
    const auto [it, is_new] = open_runs.try_emplace({run.first_place, run.last_place}, runs.size());
    if (!is_new && runs[it->second].last_line == run.first_line - 1) {
      runs[it->second].last_line = run.last_line;
    } else {
      it->second = runs.size();
      runs.push_back(run);
    }
    begin = end;
  }
  return runs;
}

std::vector<TileRange> ranges_along(std::span<const TileKey> keys, Along along) {
  std::vector<Cell> cells;
  cells.reserve(keys.size());
  for (const TileKey& key : keys) {
    cells.push_back(along == Along::kRows ? Cell{.line = key.y, .place = key.x}
                                          : Cell{.line = key.x, .place = key.y});
  }
  if (along == Along::kColumns) {
    std::sort(cells.begin(), cells.end(), [](const Cell& a, const Cell& b) {
      return std::pair(a.line, a.place) < std::pair(b.line, b.place);
    });
  }
  std::vector<TileRange> ranges;
  for (const RangeRun& run : runs_of(cells)) {
    ranges.push_back(along == Along::kRows ? TileRange{.start_x = run.first_place,
                                                       .start_y = run.first_line,
                                                       .end_x = run.last_place,
                                                       .end_y = run.last_line}
                                           : TileRange{.start_x = run.first_line,
                                                       .start_y = run.first_place,
                                                       .end_x = run.last_line,
                                                       .end_y = run.last_place});
  }
  return ranges;
}

}  // namespace

std::vector<TileRange> merge_ranges(std::span<const TileKey> keys) {
  for (std::size_t i = 1; i < keys.size(); ++i) {
    QMPIPE_CHECK(keys[i - 1] < keys[i] && keys[i].zoom == keys.front().zoom);
  }
  std::vector<TileRange> by_rows = ranges_along(keys, Along::kRows);
  std::vector<TileRange> by_columns = ranges_along(keys, Along::kColumns);
  return by_columns.size() < by_rows.size() ? by_columns : by_rows;
}

RectangleDeg bounds_of_deepest(std::span<const TileKey> keys, const TilingScheme& scheme) {
  QMPIPE_CHECK(!keys.empty());
  RectangleDeg box = scheme.rectangle_deg(keys.back());
  for (auto key = keys.rbegin(); key != keys.rend() && key->zoom == keys.back().zoom; ++key) {
    const RectangleDeg tile = scheme.rectangle_deg(*key);
    box.west_deg = std::min(box.west_deg, tile.west_deg);
    box.south_deg = std::min(box.south_deg, tile.south_deg);
    box.east_deg = std::max(box.east_deg, tile.east_deg);
    box.north_deg = std::max(box.north_deg, tile.north_deg);
  }
  return box;
}

}  // namespace qmpipe
