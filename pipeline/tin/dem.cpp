#include "pipeline/tin/dem.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "formats/bytes/errors.h"
#include "formats/crs/wgs84.h"
#include "formats/tile/quantized_mesh.h"
#include "scheduler/elementary.h"
#include "stages/surface/void_posts.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kMostPostsASide = kQuantizedMax + 1;
// Rows of the raster that are read at once: few enough to be small beside the DEM, many enough that
// rows of blocks are read whole.
constexpr std::int64_t kRowsAtOnce = 256;

double plane_y_of_middle(const RasterInfo& info) {
  return info.plane.y0 + info.plane.y_per_row * static_cast<double>(info.height) / 2;
}

PostSpacing spacing_on_ellipsoid(const RasterInfo& info) {
  const double middle_deg = plane_y_of_middle(info) * info.plane.unit;
  const double top_deg = info.plane.y0 * info.plane.unit;
  const double reach_deg = std::max(std::abs(top_deg), std::abs(2 * middle_deg - top_deg));
  // Whole rasters of the globe have their outer edge on the poles, and some half a pixel beyond.
  const double pixel_deg = std::abs(info.plane.y_per_row) * info.plane.unit;
  if (!(reach_deg <= 90 + pixel_deg)) {
    throw IoError("cannot place the raster", info.path,
                  fmt::format("it reaches to a latitude of {:g} degrees", reach_deg),
                  "check its bounds with gdalinfo; name the right CRS with --source-crs EPSG:n");
  }
  constexpr double kDegree = std::numbers::pi / 180;
  const double cosine = cos_deg(middle_deg);
  const auto [across_m, along_m] = curvature_radii(middle_deg);
  return {.x_m = std::abs(info.plane.x_per_column) * info.plane.unit * kDegree * across_m * cosine,
          .y_m = std::abs(info.plane.y_per_row) * info.plane.unit * kDegree * along_m};
}

// One row of the raster into its row of posts.
void place_row(const Dem& dem, std::span<const double> pixels, std::span<float> heights_m) {
  const bool flipped = columns_run_west(dem.info.plane);
  for (std::size_t c = 0; c < pixels.size(); ++c) {
    heights_m[flipped ? pixels.size() - 1 - c : c] = static_cast<float>(pixels[c]);
  }
}

void read_heights(const RasterSource& source, Dem& dem) {
  const RasterInfo& info = dem.info;
  // Whole rows of blocks, so that none is decoded twice; where one is higher than that, GDAL's cache
  // keeps it.
  const std::int64_t rows_at_once = info.blocks.height >= kRowsAtOnce
                                        ? info.blocks.height
                                        : kRowsAtOnce / info.blocks.height * info.blocks.height;
  const std::int64_t most_rows = std::min(rows_at_once, 4 * kRowsAtOnce);
  const auto width = static_cast<std::size_t>(info.width);
  std::vector<double> strip;
  for (std::int64_t row0 = 0; row0 < info.height; row0 += most_rows) {
    const PixelWindow window{.column0 = 0,
                             .row0 = row0,
                             .width = info.width,
                             .height = std::min(most_rows, info.height - row0)};
    strip.resize(window.size());
    source.read(window, strip);
    for (std::int64_t r = 0; r < window.height; ++r) {
      const std::int64_t row = row0 + r;
      const std::int64_t j = rows_run_south(info.plane) ? info.height - 1 - row : row;
      place_row(dem, std::span(strip).subspan(static_cast<std::size_t>(r) * width, width),
                std::span(dem.heights_m).subspan(static_cast<std::size_t>(j) * width, width));
    }
  }
}

void note_voids(Dem& dem) {
  dem.valid.resize(dem.heights_m.size());
  dem.low_m = std::numeric_limits<float>::max();
  dem.high_m = std::numeric_limits<float>::lowest();
  for (std::size_t k = 0; k < dem.heights_m.size(); ++k) {
    const float height_m = dem.heights_m[k];
    dem.valid[k] = std::isnan(height_m) ? 0 : 1;
    if (dem.valid[k] == 0) {
      ++dem.void_count;
      continue;
    }
    dem.low_m = std::min(dem.low_m, height_m);
    dem.high_m = std::max(dem.high_m, height_m);
  }
}

}  // namespace

bool columns_run_west(const PixelPlane& plane) { return plane.x_per_column < 0; }
bool rows_run_south(const PixelPlane& plane) { return plane.y_per_row < 0; }

PixelPoint Dem::pixel_of(double u, double v) const {
  const double i = u / grid.u_exact.back() * (grid.width_posts - 1);
  const double j = v / grid.v_exact.back() * (grid.height_posts - 1);
  return {.column = (columns_run_west(info.plane) ? grid.width_posts - 1 - i : i) + 0.5,
          .row = (rows_run_south(info.plane) ? grid.height_posts - 1 - j : j) + 0.5};
}

PostSpacing post_spacing(const RasterInfo& info) {
  const PixelPlane& plane = info.plane;
  if (plane.x_per_row != 0 || plane.y_per_column != 0) {
    throw IoError("cannot make a TIN of", info.path, "its rows and columns are rotated in its CRS",
                  "straighten it with: gdalwarp FILE NEW.tif");
  }
  const auto [smaller, larger] = std::minmax(info.width, info.height);
  if (smaller < 2 || larger > kMostPostsASide) {
    throw IoError("cannot make a TIN of", info.path,
                  fmt::format("it has {} x {} pixels; 2 x 2 to {} x {} can be done", info.width,
                              info.height, kMostPostsASide, kMostPostsASide),
                  "take a part of it with gdal_translate -srcwin, fewer pixels with gdal_translate "
                  "-outsize, or "
                  "make tiles of it with qmpipe build");
  }
  if (info.crs.is_geographic) return spacing_on_ellipsoid(info);
  return {.x_m = std::abs(plane.x_per_column) * plane.unit,
          .y_m = std::abs(plane.y_per_row) * plane.unit};
}

Dem read_dem(const RasterSource& source) {
  Dem dem;
  dem.info = source.info();
  const PostSpacing spacing = post_spacing(dem.info);
  dem.grid = make_plane_grid(static_cast<std::int32_t>(dem.info.width),
                             static_cast<std::int32_t>(dem.info.height), spacing.x_m, spacing.y_m);
  dem.heights_m.resize(dem.post_count());
  read_heights(source, dem);
  note_voids(dem);
  if (dem.void_count == static_cast<std::int64_t>(dem.post_count())) {
    throw IoError("cannot make a TIN of", dem.info.path, "none of its pixels is valid",
                  "check its void value and mask with gdalinfo -stats");
  }
  if (dem.void_count > 0) {
    fill_voids(dem.grid.width_posts, dem.grid.height_posts, dem.valid, dem.heights_m);
  }
  return dem;
}

}  // namespace qmpipe
