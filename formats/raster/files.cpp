#include "formats/raster/files.h"

#include <cpl_vsi.h>
#include <gdal_priv.h>

#include <map>
#include <optional>

#include "formats/crs/gdal_session.h"
#include "formats/raster/dataset.h"

namespace qmpipe {
namespace {

constexpr std::int64_t kNanoseconds = 1'000'000'000;

std::optional<RasterFile> describe_file(const std::string& path) {
  VSIStatBufL status{};
  if (VSIStatL(path.c_str(), &status) != 0 || VSI_ISDIR(status.st_mode)) return std::nullopt;
  return RasterFile{.path = path,
                    .bytes = static_cast<std::int64_t>(status.st_size),
                    .modified_ns = static_cast<std::int64_t>(status.st_mtim.tv_sec) * kNanoseconds +
                                   static_cast<std::int64_t>(status.st_mtim.tv_nsec)};
}

bool is_mosaic(const std::string& path) { return EQUAL(CPLGetExtension(path.c_str()), "vrt"); }

using FilesByPath = std::map<std::string, RasterFile>;

void collect(const std::string& path, const std::vector<std::string>& open_options,
             FilesByPath& files) {
  const OpenedRaster opened = open_new_dataset(path, open_options);
  const std::vector<std::string> names = files_of(opened);
  if (names.empty()) {
    if (const auto file = describe_file(path)) files.emplace(path, *file);
  }
  for (const std::string& name : names) {
    const auto file = describe_file(name);
    if (!file) continue;
    const bool is_new = files.emplace(name, *file).second;
    // GDAL lists what a mosaic reads, not what that reads in turn.
    if (is_new && name != path && is_mosaic(name)) collect(name, open_options, files);
  }
}

}  // namespace

std::vector<RasterFile> files_of_raster(const std::string& path,
                                        const std::vector<std::string>& open_options) {
  const GdalSession quiet;
  FilesByPath by_path;
  collect(path, open_options, by_path);
  std::vector<RasterFile> files;
  for (const auto& [name, file] : by_path) files.push_back(file);
  return files;
}

}  // namespace qmpipe
