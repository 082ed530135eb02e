// Small rasters written for a test, and the places where tests find data.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "formats/sources/raster_source.h"
#include "formats/sources/source_pool.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::testing {

std::string file_in(const TemporaryFolder& folder, const std::string& name);

enum class PixelIs { kArea, kPoint };

struct RasterFixture {
  int width = 4;
  int height = 3;
  std::optional<std::array<double, 6>> geotransform = {{10, 1, 0, 50, 0, -1}};
  std::string crs = "EPSG:4326";  // empty: none
  std::string type = "Float32";   // GDAL's name
  std::optional<double> void_value = {};
  double scale = 1;
  double offset = 0;
  std::string unit = {};
  std::map<std::string, std::string> band_metadata = {};
  PixelIs pixel_is = PixelIs::kArea;
  std::vector<std::string> creation_options = {};
  // Raw value of pixel (column, row). DEFAULT: 10 row + column.
  std::function<double(int, int)> value = [](int c, int r) { return 10.0 * r + c; };
  // Per-dataset mask, one for each pixel, 0 void; empty: none.
  std::vector<std::uint8_t> mask = {};
  // Further bands, which hold 1 everywhere but 0 where column + row can be divided by seven.
  int more_bands = 0;
  // In place of that: of band, from 2 on, column and row.
  std::function<double(int, int, int)> band_value = {};
  // Of the second band and so on.
  std::vector<std::map<std::string, std::string>> more_metadata = {};
  bool has_palette = false;
};

// Adds a file to a zip archive, which is made where it is missing. Throws std::runtime_error.
void add_to_zip(const std::string& archive, const std::string& file);

// Writes a GeoTIFF. Throws std::runtime_error.
void write_raster(const std::string& path, const RasterFixture& fixture);

// The same raster in another format, by the driver's name. Throws std::runtime_error.
void copy_raster(const std::string& from, const std::string& to, const std::string& driver);

std::unique_ptr<RasterSource> open_fixture(const std::string& path, const RasterFixture& fixture);
std::vector<double> read_all(const RasterSource& source);
// Those on one grid are joined; all may be open at once.
SourcePool pool_of(const std::vector<std::string>& paths);

// A real DEM, or nothing where the data is absent (QMPIPE_DATA, else ../shared/data).
std::optional<std::string> real_data(const std::string& name);

}  // namespace qmpipe::testing
