// Writes a DEM as a tiled, compressed GeoTIFF, as a stream of blocks: memory does not grow with the
// raster. For `qmpipe synth` and for tests.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>

#include "formats/raster/grid.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

struct RasterWriterOptions {
  std::int64_t width = 0;
  std::int64_t height = 0;
  RectangleDeg bounds_deg;           // outer edges of the outermost pixels, EPSG:4326
  std::int16_t void_value = -32768;  // declared as nodata
  std::int32_t block_posts = 256;    // tile width and height in the file
};

class RasterWriter {
 public:
  // Throws IoError. BigTIFF where it may be needed.
  static std::unique_ptr<RasterWriter> create(const std::filesystem::path& path,
                                              const RasterWriterOptions& options);
  ~RasterWriter();
  // REQUIRES: the window starts on a block's corner and is one block, cut at the raster's edge;
  // heights_m.size() == window.size(); row by row from the north.
  void write_block(const PixelWindow& window, std::span<const std::int16_t> heights_m);
  // Throws IoError; only a close() that did not throw means that the file is whole.
  void close();

 private:
  struct Impl;
  explicit RasterWriter(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
