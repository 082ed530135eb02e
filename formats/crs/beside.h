// What GDAL would read of a raster's CRS, looked at before: with it GDAL and PROJ would open the files
// that it names, and wait for a pipe for ever.
#pragma once

#include <string>

namespace qmpipe {

// Throws IoError where the file `raster`, or one beside it that GDAL reads with it, holds a CRS that
// names a path, or where one beside it is a pipe or a device. Of a file that is not short its first
// and last 64 KiB are looked at. What is no local file (of the network, in other archives than ZIP)
// is not looked at.
void require_no_path_in_crs(const std::string& raster);

// Throws the IoError for the CRS of `file`, which names the path `named`.
[[noreturn]] void refuse_path_in_crs(const std::string& file, const std::string& named);

}  // namespace qmpipe
