// Which files a raster consists of, and what tells whether they have changed.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace qmpipe {

struct RasterFile {
  std::string path;
  std::int64_t bytes = 0;
  std::int64_t modified_ns = 0;  // since 1970, as the file system says
  friend bool operator==(const RasterFile&, const RasterFile&) = default;
};

// The file itself, its side files, and what a mosaic (VRT) reads, mosaics of mosaics too; sorted by
// path, no path twice. What has no size and time of its own (a subdataset's name, a database) is
// left out. `open_options`: as in HeightOptions. Throws IoError when the raster cannot be opened.
std::vector<RasterFile> files_of_raster(const std::string& path,
                                        const std::vector<std::string>& open_options);

}  // namespace qmpipe
