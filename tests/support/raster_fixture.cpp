#include "tests/support/raster_fixture.h"

#include <cpl_string.h>
#include <cpl_vsi.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "formats/sources/joined_grids.h"

namespace qmpipe::testing {
namespace {

namespace fs = std::filesystem;

void require(bool condition, const char* what) {
  if (!condition) throw std::runtime_error(std::string("fixture: ") + what);
}

void place(GDALDataset& dataset, const RasterFixture& fixture) {
  if (fixture.pixel_is == PixelIs::kPoint) dataset.SetMetadataItem("AREA_OR_POINT", "Point");
  if (fixture.geotransform) {
    std::array<double, 6> g = *fixture.geotransform;
    require(dataset.SetGeoTransform(g.data()) == CE_None, "geotransform");
  }
  if (fixture.crs.empty()) return;
  OGRSpatialReference crs;
  crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  require(crs.SetFromUserInput(fixture.crs.c_str()) == OGRERR_NONE, "crs");
  require(dataset.SetSpatialRef(&crs) == CE_None, "crs");
}

void describe(GDALRasterBand& band, const RasterFixture& fixture) {
  if (fixture.void_value) band.SetNoDataValue(*fixture.void_value);
  if (fixture.scale != 1) band.SetScale(fixture.scale);
  if (fixture.offset != 0) band.SetOffset(fixture.offset);
  if (fixture.has_palette) {
    GDALColorTable colours;
    const GDALColorEntry entry{10, 20, 30, 255};
    colours.SetColorEntry(1, &entry);
    require(band.SetColorTable(&colours) == CE_None, "palette");
  }
  if (!fixture.unit.empty()) band.SetUnitType(fixture.unit.c_str());
  for (const auto& [name, value] : fixture.band_metadata) {
    band.SetMetadataItem(name.c_str(), value.c_str());
  }
}

void fill(GDALDataset& dataset, const RasterFixture& fixture) {
  GDALRasterBand& band = *dataset.GetRasterBand(1);
  std::vector<double> row(static_cast<std::size_t>(fixture.width));
  for (int r = 0; r < fixture.height; ++r) {
    for (int c = 0; c < fixture.width; ++c) {
      row[static_cast<std::size_t>(c)] = fixture.value(c, r);
    }
    require(band.RasterIO(GF_Write, 0, r, fixture.width, 1, row.data(), fixture.width, 1,
                          GDT_Float64, 0, 0, nullptr) == CE_None,
            "values");
    for (int b = 0; b < fixture.more_bands; ++b) {
      for (int c = 0; c < fixture.width; ++c) {
        row[static_cast<std::size_t>(c)] = fixture.band_value ? fixture.band_value(2 + b, c, r)
                                           : (c + r) % 7 == 0 ? 0
                                                              : 1;
      }
      require(dataset.GetRasterBand(2 + b)->RasterIO(GF_Write, 0, r, fixture.width, 1, row.data(),
                                                     fixture.width, 1, GDT_Float64, 0, 0,
                                                     nullptr) == CE_None,
              "values of more bands");
    }
  }
  for (std::size_t b = 0; b < fixture.more_metadata.size(); ++b) {
    for (const auto& [name, value] : fixture.more_metadata[b]) {
      dataset.GetRasterBand(2 + static_cast<int>(b))->SetMetadataItem(name.c_str(), value.c_str());
    }
  }
  if (fixture.mask.empty()) return;
  std::vector<std::uint8_t> mask = fixture.mask;
  require(dataset.CreateMaskBand(GMF_PER_DATASET) == CE_None, "mask");
  require(band.GetMaskBand()->RasterIO(GF_Write, 0, 0, fixture.width, fixture.height, mask.data(),
                                       fixture.width, fixture.height, GDT_Byte, 0, 0,
                                       nullptr) == CE_None,
          "mask");
}

}  // namespace

std::string file_in(const TemporaryFolder& folder, const std::string& name) {
  return (folder.path() / name).string();
}

void add_to_zip(const std::string& archive, const std::string& file) {
  std::ifstream in(file, std::ios::binary);
  const std::string bytes{std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>()};
  const std::string inside = "/vsizip/" + archive + "/" + fs::path(file).filename().string();
  VSILFILE* const out = VSIFOpenL(inside.c_str(), "wb");
  require(out != nullptr, "zip");
  require(VSIFWriteL(bytes.data(), 1, bytes.size(), out) == bytes.size(), "zip");
  require(VSIFCloseL(out) == 0, "zip");
}

void write_raster(const std::string& path, const RasterFixture& fixture) {
  GDALAllRegister();
  CPLStringList options;
  for (const std::string& option : fixture.creation_options) options.AddString(option.c_str());
  GDALDriver* const driver = GetGDALDriverManager()->GetDriverByName("GTiff");
  GDALDataset* const dataset =
      driver->Create(path.c_str(), fixture.width, fixture.height, 1 + fixture.more_bands,
                     GDALGetDataTypeByName(fixture.type.c_str()), options.List());
  require(dataset != nullptr, "create");
  place(*dataset, fixture);
  describe(*dataset->GetRasterBand(1), fixture);
  fill(*dataset, fixture);
  GDALClose(GDALDataset::ToHandle(dataset));
}

void copy_raster(const std::string& from, const std::string& to, const std::string& driver) {
  GDALAllRegister();
  GDALDatasetH const source = GDALOpen(from.c_str(), GA_ReadOnly);
  require(source != nullptr, "open");
  GDALDriverH const into = GDALGetDriverByName(driver.c_str());
  require(into != nullptr, "driver");
  GDALDatasetH const copy =
      GDALCreateCopy(into, to.c_str(), source, FALSE, nullptr, nullptr, nullptr);
  require(copy != nullptr, "copy");
  GDALClose(copy);
  GDALClose(source);
}

std::unique_ptr<RasterSource> open_fixture(const std::string& path, const RasterFixture& fixture) {
  write_raster(path, fixture);
  return RasterSource::open(path);
}

std::vector<double> read_all(const RasterSource& source) {
  const PixelWindow all{.width = source.info().width, .height = source.info().height};
  std::vector<double> heights(all.size());
  source.read(all, heights);
  return heights;
}

SourcePool pool_of(const std::vector<std::string>& paths) {
  std::vector<RasterInfo> infos;
  for (const std::string& path : paths) infos.push_back(RasterSource::open(path)->info());
  join_grids(infos);
  return {std::make_shared<const std::vector<RasterInfo>>(std::move(infos)), {}, paths.size()};
}

std::optional<std::string> real_data(const std::string& name) {
  const char* folder = std::getenv("QMPIPE_DATA");
  const fs::path path =
      (folder != nullptr ? fs::path(folder) : fs::path(QMPIPE_SOURCE_DIR) / "../shared/data") /
      name;
  std::error_code ignored;
  if (!fs::exists(path, ignored)) return std::nullopt;
  return path.string();
}

}  // namespace qmpipe::testing
