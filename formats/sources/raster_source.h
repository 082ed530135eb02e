// One digital elevation model, read through GDAL: any format, any CRS.
//
// Guarantees: heights in metres (band scale, offset and unit applied); voids are NaN, whatever the
// file calls them (declared void value, NaN, infinities, |h| > 1e30, mask band), and whatever the
// user says is one.
// A RasterSource is used by one thread at a time (GDAL < 3.10); open one for each thread.
//
// Pixel coordinates are those of formats/raster/grid.h; files that say "point" are shifted to this convention
// on opening.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/heights/tally.h"
#include "formats/raster/block_cache.h"
#include "formats/raster/height_options.h"
#include "formats/raster/info.h"

namespace qmpipe {

struct OpenOptions {
  // Taken instead of the file's CRS; anything GDAL understands (EPSG:n, WKT, PROJ, a .prj file).
  // DEFAULT: empty, the file's own.
  std::string crs_override = {};
  // DEFAULT: what the file says.
  HeightOptions heights = {};
  // Is shown all values that are read; without a cache, in windows that must not overlap then.
  // DEFAULT: none.
  std::shared_ptr<HeightTally> tally = {};
  // Where decoded blocks are shared with other handles on the same file. DEFAULT: none, GDAL's own
  // cache, which knows only one handle's.
  std::shared_ptr<SourceBlockCache> cache = {};
  // The same for all handles on one file in one cache, and different for every file.
  std::uint32_t number = 0;
  Placing placing = Placing::kGlobe;
  // The opened_name of an earlier opening: nothing is searched again. DEFAULT: empty, by the path.
  std::string opened_name = {};
  // What an earlier opening of the same raster found out, with the same crs_override. The raster is
  // then opened to be read only: nothing is found out about its place. DEFAULT: none.
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

  // Where its pixels lie on the globe. REQUIRES: Placing::kGlobe, and no placement was given.
  const RasterGrid& grid() const;
  std::optional<PixelPoint> pixel_at(double longitude_deg, double latitude_deg) const {
    return grid().pixel_at(longitude_deg, latitude_deg);
  }

  // Reads a window that lies inside the raster, row by row from the top, voids as NaN.
  // REQUIRES: out.size() == window.size(). Throws IoError when the file cannot be read there, and
  // when the tally does not allow what stands there.
  void read(const PixelWindow& window, std::span<double> out) const;

 private:
  struct Impl;
  explicit RasterSource(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

// For the whole process; to be called before anything is opened.
void set_gdal_config(const std::string& name, const std::string& value);

// Bounds GDAL's own block cache for the whole process.
void set_gdal_cache_bytes(std::int64_t bytes);

}  // namespace qmpipe
