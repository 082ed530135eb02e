// CRS texts that came with somebody else's data, before GDAL and PROJ get to see them as if the user
// had written them: such a text can be an address to ask, the name of a file, or name grids to open.
#pragma once

#include <optional>
#include <string>

#include "formats/bytes/result.h"

namespace qmpipe {

// Refuses what is no CRS by itself, without a request or another file. Throws nothing.
std::optional<Error> fault_of_foreign_crs(const std::string& text);

}  // namespace qmpipe
