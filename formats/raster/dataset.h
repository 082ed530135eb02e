// Opening what the user named with GDAL: a raster, a container of rasters, or an archive around
// one. For formats/ only.
#pragma once

#include <memory>
#include <string>
#include <vector>

class GDALDataset;

namespace qmpipe {

struct CloseDataset {
  void operator()(GDALDataset* dataset) const;
};

struct OpenedRaster {
  std::unique_ptr<GDALDataset, CloseDataset> dataset;  // has at least one band
  std::string name;  // what was opened in the end, e.g. "/vsizip/a.zip/dem.asc"
  std::string driver;
  // Of the dataset that it was opened as first, where another one reads it.
  std::vector<std::string> earlier_files;
  std::vector<std::string> assumptions;
};

bool is_netcdf(GDALDataset& dataset);
// Another one than the picture's own pixels.
bool has_geotransform(GDALDataset& dataset);

// That GDAL knows to belong to it.
std::vector<std::string> files_of(const OpenedRaster& opened);

// `open_options`: NAME=VALUE for the driver. Throws IoError with the remedy. REQUIRES: a GdalSession on
// this thread.
OpenedRaster open_dataset(const std::string& path, const std::vector<std::string>& open_options);

// The same of a raster that nobody looked at before: throws IoError too where a CRS in it, in the
// files beside it or in those that a mosaic (VRT) reads names a path (formats/crs/beside.h).
OpenedRaster open_new_dataset(const std::string& path,
                              const std::vector<std::string>& open_options);

}  // namespace qmpipe
