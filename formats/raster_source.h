// One digital elevation model, read through GDAL: any format, any CRS.
//
// Guarantees: heights in metres (band scale, offset and unit applied); voids are NaN, whatever the
// file calls them (declared void value, NaN, infinities, |h| > 1e30, mask band); pixel_at() is a
// pure function of the point, so two tiles that ask for the same post get the same place.
// A RasterSource is used by one thread at a time (GDAL < 3.10); open one for each thread.
//
// Pixel coordinates: (0, 0) is the outer corner of the first pixel, pixel (c, r) covers
// [c, c+1) x [r, r+1), and its value stands at its centre (c + 0.5, r + 0.5). Files that say
// "point" are shifted to this convention on opening.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/source_block_cache.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

struct PixelPoint {
  double column = 0;
  double row = 0;
};

struct PixelWindow {
  std::int64_t column0 = 0;
  std::int64_t row0 = 0;
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::size_t size() const { return static_cast<std::size_t>(width * height); }
};

// Where pixels lie in the raster's own CRS, as its geotransform says: a pixel's outer corner (c, r)
// is at x = x0 + x_per_column c + x_per_row r, and y likewise.
struct PixelPlane {
  double x0 = 0;
  double x_per_column = 1;
  double x_per_row = 0;
  double y0 = 0;
  double y_per_column = 0;
  double y_per_row = -1;
  // One unit of x and y: degrees in a geographic CRS, else metres.
  double unit = 1;
};

// What was found out about a raster's CRS, which takes ten times as long as to open the file.
struct RasterPlacement;

struct RasterInfo {
  std::string path;
  std::string driver;
  std::string crs_name;
  std::string crs_wkt;  // of x and y; empty: unknown
  bool is_geographic = false;
  bool has_vertical_datum = false;  // the CRS is compound or 3D
  std::string type_name;            // GDAL's name of the band's type, e.g. "Int16"
  std::string unit;                 // as the band declares it, "m" when it is silent
  double metres_per_unit = 1;
  std::int64_t width = 0;
  std::int64_t height = 0;
  std::int64_t block_width = 0;
  std::int64_t block_height = 0;
  // What a SourceBlockCache keeps as one block, in pixels: one or more of the file's.
  std::int64_t cached_width = 0;
  std::int64_t cached_height = 0;
  std::int64_t cached_block_bytes = 0;
  // What an open handle on the file may keep of the block it read last.
  std::int64_t handle_bytes = 0;
  PixelPlane plane;
  // From here on only where the raster is placed on the globe.
  // Smallest extent of a pixel in degrees of longitude or latitude, measured at the centre of the
  // raster and at its corners; decides the sampling zoom.
  double pixel_deg = 0;
  // The raster's extent. east_deg - west_deg <= 360; east_deg may exceed 180 when the raster
  // crosses the antimeridian (then west_deg is in [-180, 180]).
  RectangleDeg bounds_deg;
  // True when the columns go once round the globe (to a hundredth of a pixel), so that the last
  // pixel's eastern neighbour is the first.
  bool wraps_columns = false;
  // True when the raster is in degrees of WGS84 and not rotated: then the pixel's column depends on
  // the longitude alone and its row on the latitude alone.
  bool is_separable = false;
  // How longitude and latitude become the raster's CRS, in PROJ's words.
  std::string transformation;
  // What the file leaves open and was assumed, as sentences without a full stop ("the file names no
  // CRS; ..."); the program tells the user.
  std::vector<std::string> assumptions;
  std::shared_ptr<const RasterPlacement> placement;
};

// On the globe every point must have a pixel; in the plane of its own CRS a raster needs no way from
// there to the globe, nor a CRS at all (then x and y are metres), nor a geotransform (then a pixel is
// a metre).
enum class Placing { kGlobe, kPlane };

struct OpenOptions {
  // Taken instead of the file's CRS; anything GDAL understands (EPSG:n, WKT, PROJ, a .prj file).
  // DEFAULT: empty, the file's own.
  std::string crs_override = {};
  // Where decoded blocks are shared with other handles on the same file. DEFAULT: none, GDAL's own
  // cache, which knows only one handle's.
  std::shared_ptr<SourceBlockCache> cache = {};
  // The same for all handles on one file in one cache, and different for every file.
  std::uint32_t number = 0;
  Placing placing = Placing::kGlobe;
  // What an earlier opening of the same raster found out, with the same crs_override and placing.
  // DEFAULT: none, and it is found out.
  std::shared_ptr<const RasterPlacement> placement = {};
};

class RasterSource {
 public:
  // `path` may be anything GDAL opens (a file, a .zip with one raster inside, /vsi..., a subdataset
  // name); the first band is read. Throws IoError with the remedy: missing file, no driver, no CRS,
  // no geotransform or one that cannot be inverted, CRS not tied to the globe, no band, complex
  // type; UsageError when the CRS override is no CRS.
  static std::unique_ptr<RasterSource> open(const std::string& path,
                                            const OpenOptions& options = {});
  ~RasterSource();
  RasterSource(const RasterSource&) = delete;
  RasterSource& operator=(const RasterSource&) = delete;

  const RasterInfo& info() const;

  // Where a point of the globe (WGS84) lies on the raster, exactly transformed; may lie outside the
  // raster. For rasters in degrees the longitude is first moved by multiples of 360 to within 180
  // of the raster's middle. None where the CRS does not reach the point.
  // REQUIRES: Placing::kGlobe.
  std::optional<PixelPoint> pixel_at(double longitude_deg, double latitude_deg) const;

  // Reads a window that lies inside the raster, row by row from the top, voids as NaN.
  // REQUIRES: out.size() == window.size(). Throws IoError when the file cannot be read there.
  void read(const PixelWindow& window, std::span<double> out) const;

 private:
  struct Impl;
  explicit RasterSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// Bounds GDAL's own block cache for the whole process.
void set_gdal_cache_bytes(std::int64_t bytes);

}  // namespace qmpipe
