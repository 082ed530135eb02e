#include "formats/sources/raster_source.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/crs/gdal_session.h"
#include "formats/heights/band.h"
#include "formats/heights/rule.h"
#include "formats/heights/watch.h"
#include "formats/raster/crs.h"
#include "formats/raster/dataset.h"
#include "formats/raster/placement.h"
#include "formats/raster/plane.h"
#include "formats/raster/reader.h"
#include "formats/raster/unplaced_pixels.h"
#include "scheduler/check.h"

namespace qmpipe {
struct RasterSource::Impl {
  OpenedRaster opened;
  HeightBand height_band;
  GDALRasterBand* band = nullptr;
  RasterInfo info;
  HeightOptions height_options;
  HeightRule rule;
  // Where it is placed on the globe.
  std::optional<RasterGrid> grid;
  std::optional<HeightWatch> watch;
  std::optional<RasterReader> reader;
  // Without a cache every read is taken for a new block.
  bool watches_reads = false;
  std::int64_t reads = 0;
  // Kept between reads.
  std::vector<std::uint8_t> mask;

  void open(const std::string& path, const OpenOptions& options);
  void describe(const std::string& path);
  void take_heights(const RasterCrs& crs);
  void place_in_plane(const RasterCrs& crs);
  void place_on_globe(const RasterCrs& crs);
  void note_unplaced();
  // `is_watched`: what is read counts as shown to the tally.
  void read(const PixelWindow& window, std::span<double> out, bool is_watched);
};

void RasterSource::Impl::describe(const std::string& path) {
  GDALDataset& dataset = *opened.dataset;
  height_band = height_band_of(opened, path, height_options);
  band = height_band.band;
  info.path = path;
  info.opened_name = opened.name;
  info.driver = opened.driver;
  info.width = dataset.GetRasterXSize();
  info.height = dataset.GetRasterYSize();
  info.assumptions = opened.assumptions;
  info.assumptions.insert(info.assumptions.end(), height_band.assumptions.begin(),
                          height_band.assumptions.end());
  info.band.type_name = GDALGetDataTypeName(band->GetRasterDataType());
}

void RasterSource::Impl::place_in_plane(const RasterCrs& crs) {
  info.crs.name = crs.name;
  info.crs.wkt = crs.text.wkt;
  info.crs.is_geographic = crs.is_geographic;
  info.band.reference = crs.vertical.reference;
  info.band.vertical_name = crs.vertical.name;
  info.assumptions.insert(info.assumptions.end(), crs.assumptions.begin(), crs.assumptions.end());
  const CrsNeed need = crs.text.wkt.empty() ? CrsNeed::kOptional : CrsNeed::kRequired;
  const std::optional<PixelPlane> given = plane_of(*opened.dataset, info.path, need);
  // As a picture lies: the first row is the northernmost.
  info.plane = given.value_or(PixelPlane{.y0 = static_cast<double>(info.height)});
  info.plane.unit = crs.is_geographic ? 360 / crs.turn : crs.metres_per_unit;
  if (!given) {
    info.assumptions.emplace_back("the file has no geotransform; a pixel is taken as a metre");
  }
}

void RasterSource::Impl::take_heights(const RasterCrs& crs) {
  RuledHeights heights = height_rule_of(*band, info.driver, crs, height_options);
  rule = std::move(heights.rule);
  info.band.unit = std::move(heights.unit);
  info.band.metres_per_unit = rule.metres_per_unit;
  info.assumptions.insert(info.assumptions.end(), heights.assumptions.begin(),
                          heights.assumptions.end());
}

void RasterSource::Impl::place_on_globe(const RasterCrs& crs) {
  grid = RasterGrid::place(info, crs);
  if (!grid) {
    throw IoError("cannot place the raster", info.path,
                  "its CRS '" + crs.name + "' does not lead from the raster to the globe",
                  "name the right one with --source-crs EPSG:n");
  }
  static_cast<GridInfo&>(info) = grid->info();
  info.crs.transformation = info.placement->transformation;
  if (info.placement->is_ballpark) {
    info.assumptions.push_back("no transformation is known from the datum of the CRS '" + crs.name +
                               "' to WGS84; they are taken as the same");
  }
  const RectangleDeg& b = info.bounds_deg;
  if (!(info.pixel_deg > 0) || !(b.west_deg < b.east_deg) || !(b.south_deg < b.north_deg)) {
    throw IoError("cannot place the raster", info.path,
                  "its corners do not lie on the globe in the CRS '" + info.crs.name + "'",
                  "check the bounds with gdalinfo; name the right CRS with --source-crs EPSG:n");
  }
}

// Whole maps of the globe have corners beyond it, most often void: heights there are worth a word.
void RasterSource::Impl::note_unplaced() {
  const UnplacedPixels unplaced = unplaced_pixels(*grid);
  std::int64_t heights = 0;
  PixelIndex first;
  for (const PixelIndex& pixel : unplaced.pixels) {
    std::array<double, 1> height = {std::numeric_limits<double>::quiet_NaN()};
    read({.column0 = pixel.column, .row0 = pixel.row, .width = 1, .height = 1}, height, false);
    if (std::isnan(height[0])) continue;
    if (heights++ == 0) first = pixel;
  }
  if (heights == 0) return;
  info.assumptions.push_back(fmt::format(
      "about {:.0f} % of its pixels have heights that lie nowhere on the globe (one is in "
      "column {}, row {}): the CRS '{}' does not reach there; they are left out",
      std::ceil(100 * static_cast<double>(heights) / static_cast<double>(unplaced.looked_at)),
      first.column, first.row, info.crs.name));
}

void RasterSource::Impl::read(const PixelWindow& window, std::span<double> out, bool is_watched) {
  mask.resize(rule.has_mask ? out.size() : 0);
  reader->read(window, out, mask);
  for (std::size_t k = 0; k < mask.size(); ++k) {
    if (mask[k] == 0) out[k] = std::numeric_limits<double>::quiet_NaN();
  }
  if (is_watched && watches_reads && watch->wants(reads)) {
    watch->see(out);
    watch->done(reads++, *reader);
  }
  rule.apply(out);
}

RasterSource::RasterSource(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RasterSource::~RasterSource() = default;
const RasterInfo& RasterSource::info() const { return impl_->info; }

void RasterSource::Impl::open(const std::string& path, const OpenOptions& options) {
  const std::vector<std::string>& open_options = options.heights.open_options;
  opened = options.opened_name.empty() ? open_new_dataset(path, open_options)
                                       : open_dataset(options.opened_name, open_options);
  height_options = options.heights;
  describe(path);
  // What was placed on the globe is.
  bool is_of_earth = true;
  if (options.placement) {
    info.placement = options.placement;
    place_in_plane(options.placement->crs);
    take_heights(options.placement->crs);
  } else {
    const bool on_globe = options.placing == Placing::kGlobe;
    require_no_points(*opened.dataset, path);
    const RasterCrs crs = crs_of(*opened.dataset, path, opened.name, options.crs_override,
                                 on_globe ? CrsNeed::kRequired : CrsNeed::kOptional);
    require_earth(crs, path, options.placing);
    is_of_earth = is_of_earth_size(crs);
    place_in_plane(crs);
    require_degrees(info, crs, path, options.crs_override);
    take_heights(crs);
    if (on_globe) place_on_globe(crs);
  }
  describe_blocks(*band, rule.has_mask, info);
  // In a plane it may be of another world.
  if (options.tally && is_of_earth) {
    watch.emplace(options.tally, options.number, rule, info, height_options);
  }
  reader.emplace(*band, rule.has_mask, info, options.cache, options.number,
                 watch ? &*watch : nullptr);
  watches_reads = watch && !options.cache;
  if (grid) note_unplaced();
}

std::unique_ptr<RasterSource> RasterSource::open(const std::string& path,
                                                 const OpenOptions& options) {
  const GdalSession quiet;
  auto impl = std::make_unique<Impl>();
  try {
    impl->open(path, options);
  } catch (const std::runtime_error& error) {
    // GDAL and PROJ pass on an allocation that failed as whatever they could not find or make.
    if (!quiet.lacks_memory()) throw;
    const std::string said = error.what();
    throw IoError("cannot open the raster", path,
                  "out of memory (" + said.substr(0, said.find('\n')) + ")", kNoMemoryRemedy);
  }
  return std::unique_ptr<RasterSource>(new RasterSource(std::move(impl)));
}

const RasterGrid& RasterSource::grid() const {
  QMPIPE_CHECK(impl_->grid.has_value());
  return *impl_->grid;
}

void RasterSource::read(const PixelWindow& window, std::span<double> out) const {
  Impl& impl = *impl_;
  QMPIPE_CHECK(window.width > 0 && window.height > 0 && out.size() == window.size());
  QMPIPE_CHECK(window.column0 >= 0 && window.column0 + window.width <= impl.info.width);
  QMPIPE_CHECK(window.row0 >= 0 && window.row0 + window.height <= impl.info.height);
  impl.read(window, out, true);
}

void set_gdal_config(const std::string& name, const std::string& value) {
  CPLSetConfigOption(name.c_str(), value.c_str());
}

void set_gdal_cache_bytes(std::int64_t bytes) { GDALSetCacheMax64(bytes); }

}  // namespace qmpipe
