#include "formats/raster_source.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "formats/crs_transform.h"
#include "formats/errors.h"
#include "formats/gdal_session.h"
#include "formats/height_unit.h"
#include "formats/raster_crs.h"
#include "formats/raster_dataset.h"
#include "formats/raster_extent.h"
#include "formats/raster_reader.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr double kLargestHeight = 1e30;
constexpr double kVoid = std::numeric_limits<double>::quiet_NaN();
// Files store the pixel size with a dozen digits at best, which adds up over the columns.
constexpr double kWrapTolerancePixels = 0.01;
// The same place after a transformation: a micrometre.
constexpr double kSamePlaceDeg = 1e-11;

// x = a + b column + c row, y = d + e column + f row (GDAL's geotransform), and its inverse.
struct Affine {
  double a = 0;
  double b = 1;
  double c = 0;
  double d = 0;
  double e = 0;
  double f = 1;

  double determinant() const { return b * f - c * e; }
  bool is_axis_aligned() const { return c == 0 && e == 0; }
  MapPoint map_of(const PixelPoint& p) const {
    return {.x = a + b * p.column + c * p.row, .y = d + e * p.column + f * p.row};
  }
  PixelPoint pixel_of(const MapPoint& m) const {
    const double x = m.x - a;
    const double y = m.y - d;
    // Divided one by one, so that a column depends on x alone, to the last bit.
    if (is_axis_aligned()) return {.column = x / b, .row = y / f};
    return {.column = (f * x - c * y) / determinant(), .row = (b * y - e * x) / determinant()};
  }
};

// How the band's raw values become metres.
struct HeightRule {
  double void_value = kVoid;  // NaN when none is declared: nothing equals it
  bool has_mask = false;
  double scale = 1;
  double offset = 0;
  double metres_per_unit = 1;

  double height_m(double raw) const {
    // Without branches, so that a row's worth is done several at a time. False for NaN.
    const bool is_height = (std::abs(raw) <= kLargestHeight) & (raw != void_value);
    const double height = (raw * scale + offset) * metres_per_unit;
    return (is_height & (std::abs(height) <= kLargestHeight)) ? height : kVoid;
  }
};

// None when the file has no geotransform and does not need one: in a plane without CRS.
std::optional<Affine> affine_of(GDALDataset& dataset, const std::string& path, CrsNeed need) {
  std::array<double, 6> g{};
  const bool is_given = dataset.GetGeoTransform(g.data()) == CE_None;
  if (!is_given || g == std::array<double, 6>{0, 1, 0, 0, 0, 1}) {
    const bool has_points = dataset.GetGCPCount() > 0;
    if (need == CrsNeed::kOptional && !has_points) return std::nullopt;
    throw IoError("cannot place the raster", path,
                  has_points ? "it has ground control points, but no geotransform"
                             : "it has no geotransform: nothing says where its pixels lie",
                  has_points ? "make a georeferenced one with: gdalwarp FILE NEW.tif"
                             : "write the bounds into it: gdal_translate -a_ullr WEST NORTH EAST "
                               "SOUTH FILE NEW.tif");
  }
  const Affine affine{g[0], g[1], g[2], g[3], g[4], g[5]};
  const double area = affine.determinant();
  if (!std::isfinite(area) || area == 0 || !std::isfinite(g[0]) || !std::isfinite(g[3])) {
    throw IoError("cannot place the raster", path,
                  fmt::format("its geotransform ({}) cannot be inverted", fmt::join(g, ", ")),
                  "write the bounds into it: gdal_translate -a_ullr WEST NORTH EAST SOUTH FILE "
                  "NEW.tif");
  }
  return affine;
}

double void_value_of(GDALRasterBand& band) {
  int is_set = 0;
  const GDALDataType type = band.GetRasterDataType();
  double value = 0;
  if (type == GDT_Int64) {
    value = static_cast<double>(band.GetNoDataValueAsInt64(&is_set));
  } else if (type == GDT_UInt64) {
    value = static_cast<double>(band.GetNoDataValueAsUInt64(&is_set));
  } else {
    value = band.GetNoDataValue(&is_set);
  }
  if (is_set == 0 || !(std::abs(value) <= kLargestHeight)) return kVoid;
  // The file's own values went through a float.
  if (type == GDT_Float32) value = static_cast<double>(static_cast<float>(value));
  return value;
}

HeightRule height_rule_of(GDALRasterBand& band, const RasterCrs& crs, RasterInfo& info) {
  HeightRule rule{.void_value = void_value_of(band)};
  const int flags = band.GetMaskFlags();
  rule.has_mask = (flags & GMF_ALL_VALID) == 0 && flags != GMF_NODATA;
  const double scale = band.GetScale();
  const double offset = band.GetOffset();
  if (std::isfinite(scale) && scale != 0 && std::isfinite(offset)) {
    rule.scale = scale;
    rule.offset = offset;
  } else {
    info.assumptions.push_back(fmt::format(
        "the band's scale {} and offset {} make no sense and are ignored", scale, offset));
  }
  info.unit = band.GetUnitType() != nullptr ? band.GetUnitType() : "";
  if (info.unit.empty() && !crs.vertical_unit.empty()) {
    info.unit = crs.vertical_unit;
    rule.metres_per_unit = crs.vertical_metres_per_unit;
  } else if (const std::optional<double> metres = metres_per_unit(info.unit)) {
    rule.metres_per_unit = *metres;
  } else {
    info.assumptions.push_back("the unit of height '" + info.unit +
                               "' is unknown; metres are taken");
  }
  if (info.unit.empty()) info.unit = "m";
  info.metres_per_unit = rule.metres_per_unit;
  return rule;
}

std::vector<MapPoint> sample_points(const Affine& affine, const RasterInfo& info) {
  constexpr int kSteps = 8;
  std::vector<MapPoint> points;
  for (int r = 0; r <= kSteps; ++r) {
    for (int c = 0; c <= kSteps; ++c) {
      points.push_back(affine.map_of({static_cast<double>(info.width) * c / kSteps,
                                      static_cast<double>(info.height) * r / kSteps}));
    }
  }
  return points;
}

// Then no transformation need be called at all.
bool leaves_degrees_alone(const CrsTransform& transform, std::span<const MapPoint> points) {
  return std::all_of(points.begin(), points.end(), [&transform](const MapPoint& point) {
    if (std::abs(point.y) > 90) return true;
    const LonLat at{.longitude_deg = std::remainder(point.x, 360.0), .latitude_deg = point.y};
    const std::optional<MapPoint> same = transform.forward(at);
    return same && std::abs(same->y - at.latitude_deg) <= kSamePlaceDeg &&
           std::abs(std::remainder(same->x - at.longitude_deg, 360.0)) <= kSamePlaceDeg;
  });
}

}  // namespace

struct RasterPlacement {
  RasterCrs crs;
  bool is_identity = false;
  std::string transformation = {};
  bool is_ballpark = false;
};

struct RasterSource::Impl {
  OpenedRaster opened;
  GDALRasterBand* band = nullptr;
  RasterInfo info;
  Affine affine;
  HeightRule rule;
  std::unique_ptr<CrsTransform> transform;
  bool is_identity = false;
  // Of a geographic CRS, in its own unit (degrees, rarely grads): once round, and the raster's
  // middle.
  double turn = 360;
  double middle_x = 0;
  std::optional<RasterReader> reader;
  // Kept between reads.
  std::vector<std::uint8_t> mask;

  void describe(const std::string& path);
  void place_in_plane(const RasterCrs& crs);
  void make_transform(const RasterCrs& crs, std::span<const MapPoint> points);
  RasterPlacement placed_on_globe(RasterCrs crs);
  void place_on_globe(const RasterPlacement& placement);
  void measure();
  std::optional<PixelPoint> pixel_at(const LonLat& point) const;
  std::optional<LonLat> globe_at(const PixelPoint& point) const;
};

std::optional<PixelPoint> RasterSource::Impl::pixel_at(const LonLat& point) const {
  MapPoint map{.x = point.longitude_deg, .y = point.latitude_deg};
  if (!is_identity) {
    const std::optional<MapPoint> projected = transform->forward(point);
    if (!projected) return std::nullopt;
    map = *projected;
  }
  if (info.is_geographic) map.x -= turn * std::floor((map.x - middle_x + turn / 2) / turn);
  return affine.pixel_of(map);
}

std::optional<LonLat> RasterSource::Impl::globe_at(const PixelPoint& point) const {
  const MapPoint map = affine.map_of(point);
  if (is_identity) return LonLat{.longitude_deg = map.x, .latitude_deg = map.y};
  return transform->inverse(map);
}

void RasterSource::Impl::describe(const std::string& path) {
  GDALDataset& dataset = *opened.dataset;
  band = dataset.GetRasterBand(1);
  info.path = path;
  info.driver = dataset.GetDriver() != nullptr ? dataset.GetDriver()->GetDescription() : "unknown";
  info.width = dataset.GetRasterXSize();
  info.height = dataset.GetRasterYSize();
  info.assumptions = opened.assumptions;
  const GDALDataType type = band->GetRasterDataType();
  info.type_name = GDALGetDataTypeName(type);
  if (GDALDataTypeIsComplex(type) != 0) {
    throw IoError("cannot read heights from", path, "its values are complex numbers",
                  "write the part that holds heights with gdal_calc.py or gdal_translate");
  }
  if (dataset.GetRasterCount() > 1 && info.driver != "BAG" &&
      dataset.GetRasterBand(2)->GetColorInterpretation() != GCI_AlphaBand) {
    info.assumptions.push_back(
        fmt::format("the file has {} bands; the first is taken", dataset.GetRasterCount()));
  }
}

void RasterSource::Impl::place_in_plane(const RasterCrs& crs) {
  info.crs_name = crs.name;
  info.crs_wkt = crs.text.wkt;
  info.is_geographic = crs.is_geographic;
  info.has_vertical_datum = crs.has_vertical_datum;
  info.assumptions.insert(info.assumptions.end(), crs.assumptions.begin(), crs.assumptions.end());
  const CrsNeed need = crs.text.wkt.empty() ? CrsNeed::kOptional : CrsNeed::kRequired;
  const std::optional<Affine> given = affine_of(*opened.dataset, info.path, need);
  // As a picture lies: the first row is the northernmost.
  affine = given.value_or(Affine{0, 1, 0, static_cast<double>(info.height), 0, -1});
  if (!given) {
    info.assumptions.emplace_back("the file has no geotransform; a pixel is taken as a metre");
  }
  info.plane = {.x0 = affine.a,
                .x_per_column = affine.b,
                .x_per_row = affine.c,
                .y0 = affine.d,
                .y_per_column = affine.e,
                .y_per_row = affine.f,
                .unit = crs.is_geographic ? 360 / crs.turn : crs.metres_per_unit};
  rule = height_rule_of(*band, crs, info);
}

void RasterSource::Impl::make_transform(const RasterCrs& crs, std::span<const MapPoint> points) {
  transform = CrsTransform::make(crs.text, points);
  if (transform) return;
  throw IoError("cannot place the raster", info.path,
                "its CRS '" + crs.name + "' does not lead from the raster to the globe",
                "name the right one with --source-crs EPSG:n");
}

RasterPlacement RasterSource::Impl::placed_on_globe(RasterCrs crs) {
  const std::vector<MapPoint> points = sample_points(affine, info);
  make_transform(crs, points);
  RasterPlacement placement{.crs = std::move(crs),
                            .transformation = transform->name(),
                            .is_ballpark = transform->is_ballpark()};
  placement.is_identity = placement.crs.is_geographic && leaves_degrees_alone(*transform, points);
  return placement;
}

void RasterSource::Impl::place_on_globe(const RasterPlacement& placement) {
  is_identity = placement.is_identity;
  if (is_identity) {
    // It holds a connection to PROJ's database, one for each raster.
    transform.reset();
  } else if (!transform) {
    make_transform(placement.crs, sample_points(affine, info));
  }
  info.transformation = placement.transformation;
  if (placement.is_ballpark) {
    info.assumptions.push_back("no transformation is known from the datum of the CRS '" +
                               placement.crs.name + "' to WGS84; they are taken as the same");
  }
  turn = placement.crs.turn;
  info.is_separable = is_identity && affine.is_axis_aligned();
  middle_x =
      affine.map_of({static_cast<double>(info.width) / 2, static_cast<double>(info.height) / 2}).x;
}

void RasterSource::Impl::measure() {
  const RasterSize size{.width = info.width, .height = info.height};
  const ToGlobe to_globe = [this](const PixelPoint& p) { return globe_at(p); };
  if (info.is_separable) {
    const MapPoint first = affine.map_of({0, 0});
    const MapPoint last =
        affine.map_of({static_cast<double>(info.width), static_cast<double>(info.height)});
    info.bounds_deg = tidy_bounds({.west_deg = std::min(first.x, last.x),
                                   .south_deg = std::min(first.y, last.y),
                                   .east_deg = std::max(first.x, last.x),
                                   .north_deg = std::max(first.y, last.y)});
    info.pixel_deg = std::min(std::abs(affine.b), std::abs(affine.f));
    const double turn_pixels = 360 / std::abs(affine.b);
    info.wraps_columns =
        std::abs(turn_pixels - static_cast<double>(info.width)) <= kWrapTolerancePixels;
  } else {
    const std::optional<RectangleDeg> bounds =
        bounds_on_globe(size, to_globe, [this](const LonLat& p) { return pixel_at(p); });
    if (bounds) info.bounds_deg = *bounds;
    info.pixel_deg = smallest_pixel_deg(size, to_globe);
  }
  const RectangleDeg& b = info.bounds_deg;
  if (!(info.pixel_deg > 0) || !(b.west_deg < b.east_deg) || !(b.south_deg < b.north_deg)) {
    throw IoError("cannot place the raster", info.path,
                  "its corners do not lie on the globe in the CRS '" + info.crs_name + "'",
                  "check the bounds with gdalinfo; name the right CRS with --source-crs EPSG:n");
  }
}

RasterSource::RasterSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RasterSource::~RasterSource() = default;
const RasterInfo& RasterSource::info() const { return impl_->info; }

std::unique_ptr<RasterSource> RasterSource::open(const std::string& path,
                                                 const OpenOptions& options) {
  const GdalSession quiet;
  auto impl = std::make_unique<Impl>();
  impl->opened = open_dataset(path);
  impl->describe(path);
  const bool on_globe = options.placing == Placing::kGlobe;
  if (options.placement) {
    impl->info.placement = options.placement;
    impl->place_in_plane(options.placement->crs);
  } else {
    RasterCrs crs = crs_of(*impl->opened.dataset, path, impl->opened.name, options.crs_override,
                           on_globe ? CrsNeed::kRequired : CrsNeed::kOptional);
    impl->place_in_plane(crs);
    impl->info.placement = std::make_shared<const RasterPlacement>(
        on_globe ? impl->placed_on_globe(std::move(crs)) : RasterPlacement{.crs = std::move(crs)});
  }
  if (on_globe) {
    impl->place_on_globe(*impl->info.placement);
    impl->measure();
  }
  describe_blocks(*impl->band, impl->rule.has_mask, impl->info);
  impl->reader.emplace(*impl->band, impl->rule.has_mask, impl->info, options.cache, options.number);
  return std::unique_ptr<RasterSource>(new RasterSource(std::move(impl)));
}

std::optional<PixelPoint> RasterSource::pixel_at(double longitude_deg, double latitude_deg) const {
  QMPIPE_CHECK(impl_->info.pixel_deg > 0);
  return impl_->pixel_at({.longitude_deg = longitude_deg, .latitude_deg = latitude_deg});
}

void RasterSource::read(const PixelWindow& window, std::span<double> out) const {
  Impl& impl = *impl_;
  QMPIPE_CHECK(window.width > 0 && window.height > 0 && out.size() == window.size());
  QMPIPE_CHECK(window.column0 >= 0 && window.column0 + window.width <= impl.info.width);
  QMPIPE_CHECK(window.row0 >= 0 && window.row0 + window.height <= impl.info.height);
  impl.mask.resize(impl.rule.has_mask ? out.size() : 0);
  impl.reader->read(window, out, impl.mask);
  for (double& value : out) value = impl.rule.height_m(value);
  if (!impl.rule.has_mask) return;
  for (std::size_t k = 0; k < out.size(); ++k) {
    if (impl.mask[k] == 0) out[k] = kVoid;
  }
}

void set_gdal_cache_bytes(std::int64_t bytes) { GDALSetCacheMax64(bytes); }

}  // namespace qmpipe
