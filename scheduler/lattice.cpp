#include "scheduler/lattice.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "scheduler/check.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

// Before anything is shifted by it.
std::int32_t checked_zoom(std::int32_t zoom) {
  QMPIPE_CHECK(zoom >= 0 && zoom <= kMaxZoom);
  return zoom;
}

}  // namespace

Lattice::Lattice(TilingScheme scheme, std::int32_t zoom)
    : scheme_(scheme),
      zoom_(checked_zoom(zoom)),
      columns_(std::int64_t{scheme.columns(zoom)} * kTileIntervals),
      rows_(std::int64_t{scheme.rows(zoom)} * kTileIntervals + 1) {}

double Lattice::column_spacing_deg() const { return 360.0 / static_cast<double>(columns_); }

// 360 / columns is 45 or 90 times a power of two over 64, hence exact, and so is its product with
// any column: the same post has the same coordinates at every zoom.
double Lattice::longitude_deg(std::int64_t i) const {
  return -180.0 + static_cast<double>(i) * column_spacing_deg();
}

double Lattice::latitude_deg(std::int64_t j) const {
  const auto row = static_cast<double>(j);
  const auto intervals = static_cast<double>(rows_ - 1);
  if (scheme_.projection() == Projection::kGeodetic) return -90.0 + row * (180.0 / intervals);
  // The Mercator ordinate as a fraction of pi is exact; symmetric rows give opposite latitudes.
  const double y = 2.0 * row / intervals - 1.0;
  return atan2_deg(hyperbolic_sine(std::numbers::pi * y), 1);
}

double Lattice::column_at(double longitude_deg) const {
  return (longitude_deg + 180.0) / column_spacing_deg();
}

double Lattice::row_at(double latitude_deg) const {
  const auto intervals = static_cast<double>(rows_ - 1);
  if (scheme_.projection() == Projection::kGeodetic) {
    return (latitude_deg + 90.0) / 180.0 * intervals;
  }
  const double clamped_deg =
      std::clamp(latitude_deg, this->latitude_deg(0), this->latitude_deg(rows_ - 1));
  const auto [sine, cosine] = sin_cos_deg(std::abs(clamped_deg));
  // The same for both hemispheres, and no difference of near numbers in the logarithm.
  const double y = std::copysign(logarithm((1 + sine) / cosine), clamped_deg);
  return (y / std::numbers::pi + 1.0) / 2.0 * intervals;
}

PostWindow Lattice::tile_window(const TileKey& key, std::int32_t halo_posts) {
  return {.i0 = first_post(key.x) - halo_posts,
          .j0 = first_post(key.y) - halo_posts,
          .width_posts = kTilePosts + 2 * halo_posts,
          .height_posts = kTilePosts + 2 * halo_posts};
}

}  // namespace qmpipe
