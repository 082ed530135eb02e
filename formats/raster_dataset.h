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
  std::vector<std::string> assumptions;
};

// Throws IoError with the remedy. REQUIRES: a GdalSession on this thread.
OpenedRaster open_dataset(const std::string& path);

}  // namespace qmpipe
