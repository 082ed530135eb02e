#include "formats/sources/grid_pixels.h"

#include <algorithm>
#include <cmath>
#include <unordered_map>

#include "formats/heights/void_height.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Empty, with a width or height that is not positive, where they do not meet.
PixelWindow common_part(const PixelWindow& a, const PixelWindow& b) {
  PixelWindow common{.column0 = std::max(a.column0, b.column0), .row0 = std::max(a.row0, b.row0)};
  common.width = std::min(a.column0 + a.width, b.column0 + b.width) - common.column0;
  common.height = std::min(a.row0 + a.height, b.row0 + b.height) - common.row0;
  return common;
}

bool has_void(std::span<const double> values, const PixelWindow& window, std::int64_t stride) {
  for (std::int64_t r = 0; r < window.height; ++r) {
    const auto row = values.subspan(static_cast<std::size_t>(r * stride),
                                    static_cast<std::size_t>(window.width));
    if (std::any_of(row.begin(), row.end(), [](double h) { return std::isnan(h); })) return true;
  }
  return false;
}

}  // namespace

GridPixels::GridPixels(const SourcePool& pool) {
  std::unordered_map<const GridInfo*, std::size_t> numbers;
  for (std::size_t k = 0; k < pool.size(); ++k) {
    const RasterInfo& raster = pool.info(k);
    const GridInfo& grid = pool.grid_info(k);
    const std::size_t number = numbers.try_emplace(&grid, numbers.size()).first->second;
    grid_of_.push_back(number);
    if (number == pieces_.size()) pieces_.emplace_back();
    // Where the grid goes round the globe, what is beyond its last column is at its first.
    std::int64_t column = 0;
    std::int64_t on_grid = raster.part.column;
    while (column < raster.width) {
      const std::int64_t width = std::min(raster.width - column, grid.width - on_grid);
      QMPIPE_CHECK(width > 0 && raster.part.row + raster.height <= grid.height);
      pieces_[number].push_back({.raster = k,
                                 .on_grid = {.column0 = on_grid,
                                             .row0 = raster.part.row,
                                             .width = width,
                                             .height = raster.height},
                                 .column = column});
      column += width;
      on_grid = 0;
    }
  }
}

void GridPixels::read_piece(SourcePool& pool, const Piece& piece, const PixelWindow& window,
                            std::span<double> out, std::int64_t stride) {
  const RasterSource& raster = pool.source(piece.raster);
  const PixelWindow part{.column0 = window.column0 - piece.on_grid.column0 + piece.column,
                         .row0 = window.row0 - piece.on_grid.row0,
                         .width = window.width,
                         .height = window.height};
  if (part.width == stride) {
    const std::span<double> whole = out.first(part.size());
    if (std::all_of(whole.begin(), whole.end(), [](double h) { return std::isnan(h); })) {
      raster.read(part, whole);
      return;
    }
  }
  buffer_.resize(part.size());
  raster.read(part, buffer_);
  for (std::int64_t r = 0; r < part.height; ++r) {
    const double* const from = buffer_.data() + r * part.width;
    double* const to = out.data() + r * stride;
    for (std::int64_t c = 0; c < part.width; ++c) to[c] = std::isnan(to[c]) ? from[c] : to[c];
  }
}

void GridPixels::read(SourcePool& pool, std::size_t grid, std::size_t last_raster,
                      const PixelWindow& window, std::span<double> out, std::int64_t stride) {
  QMPIPE_CHECK(grid < pieces_.size() && window.width > 0 && window.height > 0);
  for (std::int64_t r = 0; r < window.height; ++r) {
    std::fill_n(out.begin() + r * stride, window.width, kVoidHeight);
  }
  for (const Piece& piece : pieces_[grid]) {
    if (piece.raster > last_raster) break;
    const PixelWindow part = common_part(piece.on_grid, window);
    if (part.width <= 0 || part.height <= 0) continue;
    const auto start = static_cast<std::size_t>((part.row0 - window.row0) * stride + part.column0 -
                                                window.column0);
    // Others have all of it already.
    if (!has_void(out.subspan(start), part, stride)) continue;
    read_piece(pool, piece, part, out.subspan(start), stride);
  }
}

}  // namespace qmpipe
