// HeightOptions as JSON text: in the recipe of layer.json and in fingerprints.
#pragma once

#include <string>

#include "formats/bytes/result.h"
#include "formats/raster/height_options.h"

namespace qmpipe {

// An object with what differs from the default, under the names of the options: {"void":"-9999"}. Not
// in it are secrets and the values of "config", nor of open options that name files, whose names stand
// there too.
std::string write_heights(const HeightOptions& heights);
Result<HeightOptions> parse_heights(const std::string& text);

}  // namespace qmpipe
