// The height at a place between pixels: bilinear, cubic (Keys, a = -1/2), nearest.
//
// Guarantees: a result depends on the place and the heights of its neighbours alone; it is void
// where the pixel that contains the place is void; valid neighbours that stand beside void ones
// keep their weights' proportions (cubic becomes bilinear there). Exact at pixel centres; bilinear
// reproduces planes, cubic also quadrics.
#pragma once

#include <cstdint>
#include <optional>
#include <span>

#include "formats/raster/grid.h"

namespace qmpipe {

enum class Resampling { kBilinear, kCubic, kNearest };

struct RasterShape {
  std::int64_t width = 0;
  std::int64_t height = 0;
  bool wraps_columns = false;
};

// Within the outer edges of the pixels, to a millionth of a pixel; false for NaN.
bool is_on_raster(const PixelPoint& place, const RasterShape& shape);

// Which pixels a set of places needs. Columns and rows may lie outside the raster: beyond its edges
// the outermost pixels are repeated, and where columns wrap they go on round the globe.
struct NeededPixels {
  PixelWindow window;
  // The places stand on both sides of the raster's seam: those in its western half are counted one
  // turn further east.
  bool crosses_seam = false;
};
// None when no place is on the raster.
class PlaceBounds {
 public:
  explicit PlaceBounds(const RasterShape& shape) : shape_(shape) {}
  void add(std::span<const PixelPoint> places);
  std::optional<NeededPixels> needed(Resampling resampling) const;

 private:
  struct Range {
    double low = 1e300;
    double high = -1e300;
    void add(double value) {
      low = value < low ? value : low;
      high = value > high ? value : high;
    }
  };
  RasterShape shape_;
  Range western_;
  Range eastern_;
  Range rows_;
};

// Heights of the needed window, row by row from the top, voids NaN.
struct PixelBlock {
  NeededPixels needed;
  std::span<const double> heights_m;
};

// The height at every place that is on the raster and not on a void pixel; others leave `out` as it
// is. REQUIRES: out.size() == places.size(); the block holds what the places need.
void resample(Resampling resampling, const RasterShape& shape, const PixelBlock& block,
              std::span<const PixelPoint> places, std::span<float> out);

}  // namespace qmpipe
