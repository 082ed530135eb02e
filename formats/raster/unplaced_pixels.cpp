#include "formats/raster/unplaced_pixels.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace qmpipe {
namespace {

constexpr std::int64_t kPixelStepsPerSide = 16;
// Out to the globe and back: more than a pixel off is another place.
constexpr double kSamePixel = 1;
// A pixel's middle that is meant to be on the pole may be a last digit beyond it.
constexpr double kSameDeg = 1e-6;

bool is_placed(const RasterGrid& grid, const PixelPoint& pixel) {
  const std::optional<LonLat> at = grid.globe_at(pixel);
  if (!at || !(std::abs(at->latitude_deg) <= 90 + kSameDeg)) return false;
  const std::optional<PixelPoint> back =
      grid.pixel_at(at->longitude_deg, std::clamp(at->latitude_deg, -90.0, 90.0));
  if (!back || !(std::abs(back->row - pixel.row) <= kSamePixel)) return false;
  double off = back->column - pixel.column;
  const double turn = columns_round_globe(grid.info());
  if (turn > 0) off = std::remainder(off, turn);
  return std::abs(off) <= kSamePixel;
}

// Of so many steps from the first of `length` pixels to the last; each pixel once.
std::vector<std::int64_t> spread_over(std::int64_t length) {
  std::vector<std::int64_t> indices;
  for (std::int64_t k = 0; k <= kPixelStepsPerSide; ++k) {
    const std::int64_t index = (length - 1) * k / kPixelStepsPerSide;
    if (indices.empty() || indices.back() != index) indices.push_back(index);
  }
  return indices;
}

}  // namespace

UnplacedPixels unplaced_pixels(const RasterGrid& grid) {
  UnplacedPixels found;
  for (const std::int64_t row : spread_over(grid.info().height)) {
    for (const std::int64_t column : spread_over(grid.info().width)) {
      ++found.looked_at;
      const PixelPoint middle{.column = static_cast<double>(column) + 0.5,
                              .row = static_cast<double>(row) + 0.5};
      if (!is_placed(grid, middle)) found.pixels.push_back({.column = column, .row = row});
    }
  }
  return found;
}

}  // namespace qmpipe
