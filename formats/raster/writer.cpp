#include "formats/raster/writer.h"

#include <cpl_string.h>
#include <fmt/format.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <algorithm>
#include <array>
#include <cstring>

#include "formats/bytes/errors.h"
#include "formats/crs/gdal_session.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

constexpr char kWriteRemedy[] =
    "check the free space and the rights of the folder; the unfinished "
    "file can be deleted";

GDALDriver& geotiff_driver(const std::string& path) {
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  if (driver == nullptr) {
    throw IoError("cannot write", path, "this GDAL has no GeoTIFF driver", "install a full GDAL");
  }
  return *driver;
}

// Zstandard where this GDAL has it: three times as quick at the same size.
const char* best_compression(GDALDriver& driver) {
  const char* options = driver.GetMetadataItem(GDAL_DMD_CREATIONOPTIONLIST);
  return options != nullptr && std::strstr(options, "ZSTD") != nullptr ? "ZSTD" : "DEFLATE";
}

CPLStringList creation_options(GDALDriver& driver, std::int32_t block_posts) {
  CPLStringList list;
  list.SetNameValue("TILED", "YES");
  list.SetNameValue("BLOCKXSIZE", fmt::format("{}", block_posts).c_str());
  list.SetNameValue("BLOCKYSIZE", fmt::format("{}", block_posts).c_str());
  list.SetNameValue("COMPRESS", best_compression(driver));
  list.SetNameValue("PREDICTOR", "2");
  list.SetNameValue("BIGTIFF", "IF_SAFER");
  return list;
}

}  // namespace

struct RasterWriter::Impl {
  std::string path;
  RasterWriterOptions options;
  GDALDataset* dataset = nullptr;

  ~Impl() {
    if (dataset == nullptr) return;
    const GdalSession quiet;
    GDALClose(GDALDataset::ToHandle(dataset));
  }
  [[noreturn]] void fail(const std::string& cause) const {
    throw IoError("cannot write the raster", path, cause, kWriteRemedy);
  }
};

RasterWriter::RasterWriter(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
RasterWriter::~RasterWriter() = default;

std::unique_ptr<RasterWriter> RasterWriter::create(const std::filesystem::path& path,
                                                   const RasterWriterOptions& options) {
  QMPIPE_CHECK(options.width > 0 && options.height > 0);
  QMPIPE_CHECK(options.width <= INT32_MAX && options.height <= INT32_MAX);
  QMPIPE_CHECK(options.block_posts > 0 && options.block_posts % 16 == 0);
  const GdalSession session;
  auto impl = std::make_unique<Impl>();
  impl->path = path.string();
  impl->options = options;
  GDALDriver& driver = geotiff_driver(impl->path);
  const CPLStringList list = creation_options(driver, options.block_posts);
  impl->dataset = driver.Create(impl->path.c_str(), static_cast<int>(options.width),
                                static_cast<int>(options.height), 1, GDT_Int16, list.List());
  if (impl->dataset == nullptr) impl->fail(session.cause("GDAL could not create it"));
  const RectangleDeg& b = options.bounds_deg;
  std::array<double, 6> affine = {
      b.west_deg, (b.east_deg - b.west_deg) / static_cast<double>(options.width),   0, b.north_deg,
      0,          (b.south_deg - b.north_deg) / static_cast<double>(options.height)};
  OGRSpatialReference crs;
  crs.importFromEPSG(4326);
  crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  GDALRasterBand& band = *impl->dataset->GetRasterBand(1);
  const bool is_placed = impl->dataset->SetGeoTransform(affine.data()) == CE_None &&
                         impl->dataset->SetSpatialRef(&crs) == CE_None &&
                         band.SetNoDataValue(options.void_value) == CE_None &&
                         band.SetUnitType("m") == CE_None;
  if (!is_placed) impl->fail(session.cause("GDAL could not write its header"));
  return std::unique_ptr<RasterWriter>(new RasterWriter(std::move(impl)));
}

void RasterWriter::write_block(const PixelWindow& window, std::span<const std::int16_t> heights_m) {
  const RasterWriterOptions& o = impl_->options;
  QMPIPE_CHECK(impl_->dataset != nullptr && heights_m.size() == window.size());
  QMPIPE_CHECK(window.column0 % o.block_posts == 0 && window.row0 % o.block_posts == 0);
  QMPIPE_CHECK(window.width == std::min<std::int64_t>(o.block_posts, o.width - window.column0));
  QMPIPE_CHECK(window.height == std::min<std::int64_t>(o.block_posts, o.height - window.row0));
  const GdalSession session;
  const int width = static_cast<int>(window.width);
  const int height = static_cast<int>(window.height);
  // GDAL's interface takes a buffer it may write to, but writing a raster only reads it.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-const-cast)
  void* const values = const_cast<std::int16_t*>(heights_m.data());
  const CPLErr result = impl_->dataset->GetRasterBand(1)->RasterIO(
      GF_Write, static_cast<int>(window.column0), static_cast<int>(window.row0), width, height,
      values, width, height, GDT_Int16, 0, 0, nullptr);
  // The block before this one may only now have been compressed and written.
  if (result != CE_None || session.failed()) impl_->fail(session.cause("the disk may be full"));
}

void RasterWriter::close() {
  if (impl_->dataset == nullptr) return;
  const GdalSession session;
  // GDALClose reports nothing in GDAL 3.6, so errors are taken from what it says.
  impl_->dataset->FlushCache(true);
  GDALClose(GDALDataset::ToHandle(impl_->dataset));
  impl_->dataset = nullptr;
  if (session.failed()) impl_->fail(session.cause("the disk may be full"));
}

}  // namespace qmpipe
