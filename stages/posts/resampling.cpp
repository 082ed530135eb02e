#include "stages/posts/resampling.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/heights/void_height.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

// A post on the very edge of the raster must not fall off it by rounding.
constexpr double kEdgeSlackPixels = 1e-6;

// Four neighbours: `first` is the upper left one; right and down are in [0, 1).
struct Place {
  const double* first = nullptr;
  std::ptrdiff_t stride = 0;
  double right = 0;
  double down = 0;

  double containing_pixel() const {
    return first[(right >= 0.5 ? 1 : 0) + (down >= 0.5 ? stride : 0)];
  }
};

double middle_of(const RasterShape& shape) { return static_cast<double>(shape.width) / 2; }

double bilinear_among_voids(const Place& p) {
  if (std::isnan(p.containing_pixel())) return kVoidHeight;
  const std::array<double, 4> heights = {p.first[0], p.first[1], p.first[p.stride],
                                         p.first[p.stride + 1]};
  const std::array<double, 4> weights = {(1 - p.right) * (1 - p.down), p.right * (1 - p.down),
                                         (1 - p.right) * p.down, p.right * p.down};
  double sum = 0;
  double weight = 0;
  for (std::size_t k = 0; k < 4; ++k) {
    if (std::isnan(heights[k])) continue;
    sum += weights[k] * heights[k];
    weight += weights[k];
  }
  return sum / weight;
}

double bilinear(const Place& p) {
  const double* const lower = p.first + p.stride;
  const double above = p.first[0] + (p.first[1] - p.first[0]) * p.right;
  const double below = lower[0] + (lower[1] - lower[0]) * p.right;
  const double height = above + (below - above) * p.down;
  return std::isnan(height) ? bilinear_among_voids(p) : height;
}

std::array<double, 4> cubic_weights(double part) {
  const double t = part;
  return {((-0.5 * t + 1) * t - 0.5) * t, (1.5 * t - 2.5) * t * t + 1,
          ((-1.5 * t + 2) * t + 0.5) * t, (0.5 * t - 0.5) * t * t};
}

double cubic(const Place& p) {
  const std::array<double, 4> across = cubic_weights(p.right);
  const std::array<double, 4> down = cubic_weights(p.down);
  double height = 0;
  for (std::ptrdiff_t r = 0; r < 4; ++r) {
    const double* const row = p.first + (r - 1) * p.stride - 1;
    height += down[static_cast<std::size_t>(r)] *
              (across[0] * row[0] + across[1] * row[1] + across[2] * row[2] + across[3] * row[3]);
  }
  return std::isnan(height) ? bilinear(p) : height;
}

double nearest(const Place& p) { return p.containing_pixel(); }

// std::floor is a call where the machine's baseline has no instruction for it.
std::int64_t whole_below(double value) {
  const auto towards_zero = static_cast<std::int64_t>(value);
  return towards_zero - (value < static_cast<double>(towards_zero) ? 1 : 0);
}

template <double (*kHeightAt)(const Place&)>
void resample_with(const RasterShape& shape, const PixelBlock& block,
                   std::span<const PixelPoint> places, std::span<float> out) {
  const PixelWindow& window = block.needed.window;
  const double seam = block.needed.crosses_seam ? middle_of(shape) : -1;
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (!is_on_raster(places[k], shape)) continue;
    const double x = places[k].column - 0.5;
    const double y = places[k].row - 0.5;
    const std::int64_t row = whole_below(y);
    std::int64_t column = whole_below(x);
    const double right = x - static_cast<double>(column);
    // Moved only now, so that the part to the right does not depend on the block.
    if (places[k].column < seam) column += shape.width;
    const std::int64_t index = (row - window.row0) * window.width + (column - window.column0);
    const double height = kHeightAt({.first = block.heights_m.data() + index,
                                     .stride = static_cast<std::ptrdiff_t>(window.width),
                                     .right = right,
                                     .down = y - static_cast<double>(row)});
    if (!std::isnan(height)) out[k] = static_cast<float>(height);
  }
}

}  // namespace

bool is_on_raster(const PixelPoint& place, const RasterShape& shape) {
  return place.column >= -kEdgeSlackPixels && place.row >= -kEdgeSlackPixels &&
         place.column <= static_cast<double>(shape.width) + kEdgeSlackPixels &&
         place.row <= static_cast<double>(shape.height) + kEdgeSlackPixels;
}

void PlaceBounds::add(std::span<const PixelPoint> places) {
  const double middle = middle_of(shape_);
  for (const PixelPoint& place : places) {
    if (!is_on_raster(place, shape_)) continue;
    (place.column < middle ? western_ : eastern_).add(place.column);
    rows_.add(place.row);
  }
}

std::optional<NeededPixels> PlaceBounds::needed(Resampling resampling) const {
  if (rows_.low > rows_.high) return std::nullopt;
  Range columns{.low = std::min(western_.low, eastern_.low),
                .high = std::max(western_.high, eastern_.high)};
  NeededPixels result;
  const double turn = static_cast<double>(shape_.width);
  if (shape_.wraps_columns && western_.low <= western_.high && eastern_.low <= eastern_.high &&
      western_.high + turn - eastern_.low < columns.high - columns.low) {
    result.crosses_seam = true;
    columns = {.low = eastern_.low, .high = western_.high + turn};
  }
  const std::int64_t margin = resampling == Resampling::kCubic ? 1 : 0;
  const auto first = [margin](double low) {
    return static_cast<std::int64_t>(std::floor(low - 0.5)) - margin;
  };
  const auto count = [margin](double high, std::int64_t from) {
    return static_cast<std::int64_t>(std::floor(high - 0.5)) + 2 + margin - from;
  };
  result.window.column0 = first(columns.low);
  result.window.row0 = first(rows_.low);
  result.window.width = count(columns.high, result.window.column0);
  result.window.height = count(rows_.high, result.window.row0);
  return result;
}

void resample(Resampling resampling, const RasterShape& shape, const PixelBlock& block,
              std::span<const PixelPoint> places, std::span<float> out) {
  QMPIPE_CHECK(places.size() == out.size());
  QMPIPE_CHECK(block.heights_m.size() == block.needed.window.size());
  switch (resampling) {
    case Resampling::kBilinear:
      return resample_with<bilinear>(shape, block, places, out);
    case Resampling::kCubic:
      return resample_with<cubic>(shape, block, places, out);
    case Resampling::kNearest:
      return resample_with<nearest>(shape, block, places, out);
  }
}

}  // namespace qmpipe
