#include "perf/bench_terrain.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <stdexcept>

#include "formats/crs/transform.h"
#include "scheduler/check.h"
#include "scheduler/wavefront.h"
#include "stages/posts/height_step.h"
#include "stages/synth/synth_terrain.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::perf {
namespace {

constexpr std::uint32_t kSeed = 1;
// A tile of kDemZoom in the mountains of that planet, some 15 degrees north.
constexpr TileKey kFirstTile = {.zoom = kDemZoom, .x = 1646, .y = 596};
constexpr double kPixelDeg = 1.0 / 1200;
constexpr const char* kUtm = "EPSG:32649";

RectangleDeg rectangle_of(const TilingScheme& scheme, std::int32_t columns, std::int32_t rows) {
  const RectangleDeg first = scheme.rectangle_deg(kFirstTile);
  const RectangleDeg last = scheme.rectangle_deg(
      {.zoom = kDemZoom, .x = kFirstTile.x + columns - 1, .y = kFirstTile.y + rows - 1});
  return {.west_deg = first.west_deg,
          .south_deg = first.south_deg,
          .east_deg = last.east_deg,
          .north_deg = last.north_deg};
}

// Whole metres, row by row from the north. What a projected file holds is not bent to its place:
// only that it looks like terrain counts.
std::vector<std::int16_t> terrain_of(const RectangleDeg& box, int width, int height) {
  SynthTerrain terrain({.seed = kSeed, .pixel_deg = kPixelDeg});
  const auto columns = static_cast<std::size_t>(width);
  std::vector<double> longitudes_deg(columns);
  for (std::size_t c = 0; c < columns; ++c) {
    longitudes_deg[c] =
        box.west_deg + (static_cast<double>(c) + 0.5) * (box.east_deg - box.west_deg) / width;
  }
  std::vector<std::int16_t> heights_m(columns * static_cast<std::size_t>(height));
  for (int r = 0; r < height; ++r) {
    terrain.sample_row(
        box.north_deg - (r + 0.5) * (box.north_deg - box.south_deg) / height, longitudes_deg,
        std::span(heights_m).subspan(static_cast<std::size_t>(r) * columns, columns));
  }
  return heights_m;
}

// The rectangle's place on the plane, with a little to spare on all sides.
std::array<double, 6> utm_geotransform(const RectangleDeg& box, int width, int height) {
  const auto transform = CrsTransform::make({.wkt = kUtm}, std::array{MapPoint{5e5, 1.6e6}});
  if (transform == nullptr) throw std::runtime_error("benchmark: PROJ does not know EPSG:32649");
  double west = 1e9;
  double south = 1e9;
  double east = -1e9;
  double north = -1e9;
  constexpr int kSteps = 8;
  for (int a = 0; a <= kSteps; ++a) {
    for (int b = 0; b <= kSteps; ++b) {
      const auto point = transform->forward(
          {.longitude_deg = box.west_deg + (box.east_deg - box.west_deg) * a / kSteps,
           .latitude_deg = box.south_deg + (box.north_deg - box.south_deg) * b / kSteps});
      if (!point) throw std::runtime_error("benchmark: the terrain is outside EPSG:32649");
      west = std::min(west, point->x);
      east = std::max(east, point->x);
      south = std::min(south, point->y);
      north = std::max(north, point->y);
    }
  }
  return {west, (east - west) / width, 0, north, 0, (south - north) / height};
}

testing::RasterFixture raster_of(DemKind kind, const RectangleDeg& box) {
  testing::RasterFixture raster;
  raster.width = static_cast<int>(std::lround((box.east_deg - box.west_deg) / kPixelDeg));
  raster.height = static_cast<int>(std::lround((box.north_deg - box.south_deg) / kPixelDeg));
  const bool is_float = kind == DemKind::kFloat32Deflate;
  raster.type = is_float ? "Float32" : "Int16";
  raster.creation_options = {"TILED=YES",
                             kind == DemKind::kInt16Zstd ? "COMPRESS=ZSTD" : "COMPRESS=DEFLATE",
                             is_float ? "PREDICTOR=3" : "PREDICTOR=2"};
  if (kind == DemKind::kUtmDeflate) {
    raster.crs = kUtm;
    raster.geotransform = utm_geotransform(box, raster.width, raster.height);
  } else {
    raster.geotransform = {{box.west_deg, (box.east_deg - box.west_deg) / raster.width, 0,
                            box.north_deg, 0, (box.south_deg - box.north_deg) / raster.height}};
  }
  const auto heights_m =
      std::make_shared<std::vector<std::int16_t>>(terrain_of(box, raster.width, raster.height));
  raster.value = [heights_m, is_float, width = raster.width](int c, int r) {
    const double metres =
        (*heights_m)[static_cast<std::size_t>(r) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(c)];
    // A float DEM is not made of whole metres: add a smooth rest, in centimetres as many are.
    return is_float ? metres + std::round(50 * std::sin(0.11 * c) * std::cos(0.07 * r)) / 100
                    : metres;
  };
  return raster;
}

BenchTile sampled_tile(const std::string& name, const std::string& path, const TileKey& key) {
  BenchTile tile;
  tile.name = name;
  tile.key = key;
  const Lattice lattice(tile.scheme, key.zoom);
  tile.grid = make_tile_grid(tile.scheme, key);
  tile.window.window = Lattice::tile_window(key, 1);
  tile.window.heights_m.resize(tile.window.window.size());
  tile.window.valid.assign(tile.window.window.size(), 1);
  open_sampler(path, Resampling::kBilinear)
      ->sample(lattice, tile.window.window, tile.window.heights_m);
  // Radar left a few voids in the mountains: each takes the height of the post before it.
  float last_m = 0;
  for (float& height_m : tile.window.heights_m) {
    if (std::isnan(height_m)) height_m = last_m;
    last_m = height_m;
  }
  const PostWindow own = Lattice::tile_window(key, 0);
  for (std::int32_t j = 0; j < kTilePosts; ++j) {
    for (std::int32_t i = 0; i < kTilePosts; ++i) {
      tile.heights_m.push_back(tile.window.height_m(own.i0 + i, own.j0 + j));
    }
  }
  return tile;
}

}  // namespace

bool is_small_run() { return std::getenv("QMPIPE_PERF_SMALL") != nullptr; }

const char* name_of(DemKind kind) {
  constexpr std::array kNames = {"int16_deflate", "float32_deflate", "int16_zstd", "utm_deflate"};
  return kNames[static_cast<std::size_t>(kind)];
}

BenchDem::BenchDem(DemKind kind, std::int32_t columns, std::int32_t rows)
    : path_(testing::file_in(folder_, "dem.tif")) {
  const TilingScheme scheme(Projection::kGeodetic);
  testing::write_raster(path_, raster_of(kind, rectangle_of(scheme, columns, rows)));
  std::vector<TileKey> keys;
  for (std::int32_t y = kFirstTile.y; y < kFirstTile.y + rows; ++y) {
    for (std::int32_t x = kFirstTile.x; x < kFirstTile.x + columns; ++x) {
      keys.push_back({.zoom = kDemZoom, .x = x, .y = y});
    }
  }
  std::sort(keys.begin(), keys.end());
  for (const PlannedTile& tile : plan_wavefront(scheme, keys).tiles) tiles_.push_back(tile.key);
}

std::int64_t BenchDem::post_count() const {
  return static_cast<std::int64_t>(tiles_.size()) * kTileIntervals * kTileIntervals;
}

std::unique_ptr<Sampler> open_sampler(const std::string& path, Resampling resampling) {
  return std::make_unique<Sampler>(testing::pool_of({path}), resampling);
}

std::vector<BenchTile> bench_tiles() {
  const BenchDem dem(DemKind::kInt16Deflate, 3, 3);
  const TileKey middle = {.zoom = kDemZoom, .x = kFirstTile.x + 1, .y = kFirstTile.y + 1};
  std::vector<BenchTile> tiles;
  tiles.push_back(sampled_tile("synth", dem.path(), middle));
  // From the sea at Ventimiglia up to the ridge.
  if (const auto alps = testing::real_data("N43E007.hgt.zip")) {
    tiles.push_back(sampled_tile("alps", *alps, {.zoom = kDemZoom, .x = 1067, .y = 761}));
  }
  return tiles;
}

GreedyOptions options_for(const BenchTile& tile, double tolerance_m) {
  const auto [lowest, highest] = std::minmax_element(tile.heights_m.begin(), tile.heights_m.end());
  const auto step_m = height_step_for(tolerance_m, static_cast<double>(*highest - *lowest),
                                      std::max(std::abs(*lowest), std::abs(*highest)));
  QMPIPE_CHECK(step_m);
  return {.tolerance_m = tolerance_m, .height_steps = *step_m};
}

GreedyOptions options_for_vertices(const BenchTile& tile, std::size_t vertices) {
  const auto count = [&tile](double tolerance_m) {
    return greedy_insertion(tile.grid, tile.heights_m, {}, options_for(tile, tolerance_m))
        .vertices.size();
  };
  double coarse_m = 2000;
  while (count(coarse_m / 2) < vertices) coarse_m /= 2;
  double fine_m = coarse_m / 2;
  for (int k = 0; k < 7; ++k) {
    const double middle_m = (coarse_m + fine_m) / 2;
    (count(middle_m) < vertices ? coarse_m : fine_m) = middle_m;
  }
  return options_for(tile, fine_m);
}

}  // namespace qmpipe::perf
