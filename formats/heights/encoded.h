// Pictures whose colours encode heights, as a band of metres. For formats/ only.
#pragma once

#include <memory>
#include <optional>
#include <string>

#include "formats/raster/dataset.h"
#include "formats/raster/height_options.h"

namespace qmpipe {

// Whether its bands are colours rather than numbers.
bool is_picture(GDALDataset& dataset);

// By a glance at its colours.
std::optional<HeightEncoding> likely_encoding(GDALDataset& picture);

// A dataset of one band of float heights, void where the picture is transparent or all three colours
// are the declared void value. `picture` outlives it. Throws IoError, with `path`, for a picture that
// has no three bands of 8 bits, and for one compressed with loss, which leaves noise of its heights.
std::unique_ptr<GDALDataset, CloseDataset> decode_heights(GDALDataset& picture,
                                                          const std::string& path,
                                                          HeightEncoding encoding);

}  // namespace qmpipe
