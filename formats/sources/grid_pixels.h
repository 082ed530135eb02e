// The pixels of grids that one or several rasters lie on, read as if each grid were one raster.
//
// Guarantees: a pixel's height is that of the first raster, in the order of the pool, that has one
// there; it does not depend on the window it is read in. Used by one thread at a time, like the pool.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "formats/sources/source_pool.h"

namespace qmpipe {

class GridPixels {
 public:
  // Of all rasters of the pool, which is given to each read().
  explicit GridPixels(const SourcePool& pool);

  // The number of the grid that a raster lies on, and the last raster that does.
  std::size_t grid_of(std::size_t raster) const { return grid_of_[raster]; }
  std::size_t last_raster(std::size_t grid) const { return pieces_[grid].back().raster; }

  // A window that lies on the grid, row by row from the top in rows of `stride` values, voids NaN;
  // rasters after the last one are as if they were not there.
  // REQUIRES: out.size() >= stride * (window.height - 1) + window.width. Throws IoError.
  void read(SourcePool& pool, std::size_t grid, std::size_t last_raster, const PixelWindow& window,
            std::span<double> out, std::int64_t stride);

 private:
  // A part of a raster on its grid. One that goes past the line where the columns have gone round the
  // globe has several.
  struct Piece {
    std::size_t raster = 0;
    PixelWindow on_grid;
    // The first of these pixels in the raster itself.
    std::int64_t column = 0;
  };
  void read_piece(SourcePool& pool, const Piece& piece, const PixelWindow& window,
                  std::span<double> out, std::int64_t stride);

  std::vector<std::size_t> grid_of_;        // by raster
  std::vector<std::vector<Piece>> pieces_;  // by grid, in the order of the rasters
  std::vector<double> buffer_;
};

}  // namespace qmpipe
