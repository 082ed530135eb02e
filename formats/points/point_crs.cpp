#include "formats/points/point_crs.h"

#include <cpl_conv.h>
#include <cpl_vsi.h>
#include <fmt/format.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <array>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/little_endian.h"
#include "formats/crs/beside.h"
#include "formats/crs/gdal_session.h"
#include "formats/crs/paths.h"
#include "formats/crs/wkt.h"
#include "formats/raster/dataset.h"
#include "formats/raster/height_unit.h"

namespace qmpipe {
namespace {

constexpr char kCrsRemedy[] = "say which one it is with --source-crs EPSG:n";

using Dataset = std::unique_ptr<GDALDataset, CloseDataset>;

// A little-endian TIFF that grows tag by tag, values behind the directory.
class TagList {
 public:
  explicit TagList(std::uint16_t count) : count_(count) {
    append_little_endian(head_, std::uint16_t{0x4949});
    append_little_endian(head_, std::uint16_t{42});
    append_little_endian(head_, std::uint32_t{8});
    append_little_endian(head_, count);
  }
  void add_number(std::uint16_t tag, std::uint16_t value) {
    add_entry(tag, 3, 1);
    append_little_endian(head_, value);
    append_little_endian(head_, std::uint16_t{0});
  }
  // REQUIRES: more than four bytes.
  template <class T>
  void add_values(std::uint16_t tag, std::uint16_t type, const T& values) {
    add_entry(tag, type, static_cast<std::uint32_t>(values.size()));
    const std::size_t directory_bytes = 8 + 2 + std::size_t{12} * count_ + 4;
    append_little_endian(head_, static_cast<std::uint32_t>(directory_bytes + tail_.size()));
    for (const auto value : values) append_little_endian(tail_, value);
    if (tail_.size() % 2 != 0) tail_.push_back(0);
  }
  std::vector<std::uint8_t> finish() {
    append_little_endian(head_, std::uint32_t{0});
    head_.insert(head_.end(), tail_.begin(), tail_.end());
    return std::move(head_);
  }

 private:
  void add_entry(std::uint16_t tag, std::uint16_t type, std::uint32_t values) {
    append_little_endian(head_, tag);
    append_little_endian(head_, type);
    append_little_endian(head_, values);
  }
  std::uint16_t count_;
  std::vector<std::uint8_t> head_;
  std::vector<std::uint8_t> tail_;
};

// A GeoTIFF of one pixel with these keys: GDAL reads them nowhere else, and knows far more of them
// than a table of EPSG codes would.
std::vector<std::uint8_t> tiff_with(const LasCrs& crs) {
  // Short values would have to stand in the directory itself; unused ones at the end do no harm.
  std::vector<double> doubles = crs.geo_doubles;
  doubles.push_back(0);
  const std::string text = crs.geo_text + std::string(5, '\0');
  TagList tags(14);
  tags.add_number(256, 1);                             // width
  tags.add_number(257, 1);                             // height
  tags.add_number(258, 8);                             // bits
  tags.add_number(259, 1);                             // not compressed
  tags.add_number(262, 1);                             // black is zero
  tags.add_number(273, 0);                             // the pixel: any byte will do
  tags.add_number(277, 1);                             // bands
  tags.add_number(278, 1);                             // rows in a strip
  tags.add_number(279, 1);                             // bytes in it
  tags.add_values(33550, 12, std::array{1., 1., 0.});  // pixel's size
  tags.add_values(33922, 12, std::array{0., 0., 0., 0., 0., 0.});
  tags.add_values(34735, 3, crs.geo_keys);
  tags.add_values(34736, 12, doubles);
  tags.add_values(34737, 2, text);
  return tags.finish();
}

std::string crs_in_keys(const std::string& path, const LasCrs& crs, const GdalSession& session) {
  std::vector<std::uint8_t> bytes = tiff_with(crs);
  const std::string name =
      fmt::format("/vsimem/qmpipe-keys-{}.tif", static_cast<const void*>(bytes.data()));
  VSIFCloseL(VSIFileFromMemBuffer(name.c_str(), bytes.data(), bytes.size(), FALSE));
  // Or a CRS of GeoTIFF 1.0 loses its heights.
  CPLConfigOptionSetter compound("GTIFF_REPORT_COMPD_CS", "YES", false);
  std::string wkt;
  {
    const std::array<const char*, 2> drivers = {"GTiff", nullptr};
    const Dataset dataset(GDALDataset::Open(name.c_str(), GDAL_OF_RASTER, drivers.data()));
    const OGRSpatialReference* found = dataset ? dataset->GetSpatialRef() : nullptr;
    if (found != nullptr) wkt = wkt_of(*found);
  }
  VSIUnlink(name.c_str());
  if (wkt.empty()) {
    throw IoError("cannot use the GeoTIFF keys in", path,
                  session.cause("they name no CRS that GDAL knows"), kCrsRemedy);
  }
  return wkt;
}

// Of x and y, as a key of its own says; none where it is no foot and no metre.
std::optional<double> metres_per_unit_in_keys(const LasCrs& crs) {
  constexpr std::uint16_t kLinearUnits = 3076;
  // Rows of four: key, place of its value (0: here), count, value.
  for (std::size_t k = 4; k + 3 < crs.geo_keys.size(); k += 4) {
    if (crs.geo_keys[k] != kLinearUnits || crs.geo_keys[k + 1] != 0) continue;
    switch (crs.geo_keys[k + 3]) {
      case 9001:
        return 1;
      case 9002:
        return metres_per_unit("ft");
      case 9003:
        return metres_per_unit("us-ft");
      default:
        return std::nullopt;
    }
  }
  return std::nullopt;
}

}  // namespace

RasterCrs crs_of_points(const std::string& path, const LasCrs& crs,
                        const std::string& override_text) {
  const GdalSession session;
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("MEM");
  if (driver == nullptr) {
    throw IoError("cannot read the CRS of", path, "this GDAL has no MEM driver",
                  "install a full GDAL");
  }
  const Dataset dataset(driver->Create("", 1, 1, 1, GDT_Byte, nullptr));
  if (override_text.empty()) {
    for (const std::string& text : {crs.wkt, crs.geo_text}) {
      if (const auto named = path_in_crs(text)) refuse_path_in_crs(path, *named);
    }
    std::string wkt = crs.wkt;
    // A first row of four numbers, and four for each key.
    if (wkt.empty() && crs.geo_keys.size() >= 8) wkt = crs_in_keys(path, crs, session);
    OGRSpatialReference own;
    if (!wkt.empty() && own.importFromWkt(wkt.c_str()) != OGRERR_NONE) {
      throw IoError("cannot use the CRS in", path, session.cause("it is no well-known text"),
                    kCrsRemedy);
    }
    own.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
    // What GDAL makes of keys that name no projection is a plane in metres, whatever their unit.
    const bool names_none = wkt.empty() || (crs.wkt.empty() && own.IsLocal() != 0);
    if (!names_none) dataset->SetSpatialRef(&own);
  }
  RasterCrs found = crs_of(*dataset, path, path, override_text, CrsNeed::kOptional);
  if (const std::optional<double> unit_m = metres_per_unit_in_keys(crs);
      unit_m && found.text.wkt.empty()) {
    found.metres_per_unit = *unit_m;
    found.assumptions = {
        fmt::format("the file names no CRS, but a unit for its coordinates: {:g} m", *unit_m)};
  }
  return found;
}

double metres_per_height_unit(const RasterCrs& crs) {
  if (!crs.vertical.unit.empty()) return crs.vertical.metres_per_unit;
  return crs.is_geographic ? 1 : crs.metres_per_unit;
}

}  // namespace qmpipe
