// Which band of a file holds its heights. For formats/ only.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "formats/raster/dataset.h"
#include "formats/raster/height_options.h"

class GDALRasterBand;

namespace qmpipe {

struct HeightBand {
  GDALRasterBand* band = nullptr;
  // Of a band that is made of others; null where it is the file's own.
  std::unique_ptr<GDALDataset, CloseDataset> decoded;
  std::vector<std::string> assumptions;
};

// `opened` outlives the band. Throws IoError, with the remedy, for a picture that nobody says how to
// read, for a band that is not there, and for complex numbers.
HeightBand height_band_of(const OpenedRaster& opened, const std::string& path,
                          const HeightOptions& options);

}  // namespace qmpipe
