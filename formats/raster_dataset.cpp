#include "formats/raster_dataset.h"

#include <cpl_string.h>
#include <cpl_vsi.h>
#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <filesystem>

#include "formats/errors.h"
#include "formats/gdal_session.h"

namespace qmpipe {
namespace {

using Dataset = std::unique_ptr<GDALDataset, CloseDataset>;

constexpr unsigned kOpenFlags = GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR;

Dataset try_open(const std::string& name) {
  return Dataset(
      GDALDataset::FromHandle(GDALOpenEx(name.c_str(), kOpenFlags, nullptr, nullptr, nullptr)));
}

std::string lower_extension(const std::string& path) {
  std::string extension = std::filesystem::path(path).extension().string();
  std::transform(extension.begin(), extension.end(), extension.begin(),
                 [](unsigned char c) { return static_cast<char>(std::tolower(c)); });
  return extension;
}

// Files that stand beside a raster; some drivers would open them as one.
bool is_sidecar(const std::string& name) {
  static constexpr std::array<const char*, 12> kSidecars = {".prj", ".xml",  ".txt", ".hdr",
                                                            ".ovr", ".msk",  ".tfw", ".pdf",
                                                            ".htm", ".html", ".csv", ".md5"};
  const std::string extension = lower_extension(name);
  return name.empty() || name.back() == '/' ||
         std::find(kSidecars.begin(), kSidecars.end(), extension) != kSidecars.end();
}

// GDAL would wait for a pipe that nobody writes to, and cannot go back in one that somebody does.
void require_no_stream(const std::string& path) {
  std::error_code code;
  const std::filesystem::file_type type = std::filesystem::status(path, code).type();
  if (type != std::filesystem::file_type::fifo && type != std::filesystem::file_type::socket &&
      type != std::filesystem::file_type::character) {
    return;
  }
  throw IoError("cannot open the raster", path,
                "it is a pipe or a device, and rasters are read here and there",
                "Write it to a file first: cat PIPE > dem.tif");
}

OpenedRaster open_in_archive(const std::string& path) {
  GdalSession session;
  const std::string root = "/vsizip/" + path;
  const CPLStringList files(VSIReadDirRecursive(root.c_str()));
  std::vector<std::string> rasters;
  for (int k = 0; k < files.Count(); ++k) {
    const std::string name = root + "/" + files[k];
    if (is_sidecar(files[k])) continue;
    if (GDALIdentifyDriverEx(name.c_str(), GDAL_OF_RASTER, nullptr, nullptr) != nullptr) {
      rasters.push_back(name);
    }
  }
  if (files.Count() == 0) {
    throw IoError("cannot open the archive", path, session.cause("it is empty or damaged"),
                  "check the file with: unzip -t FILE");
  }
  if (rasters.size() != 1) {
    throw IoError("cannot open the archive", path,
                  fmt::format("it holds {} rasters, not one", rasters.size()),
                  "name the one that is meant: " +
                      (rasters.empty() ? root + "/NAME" : fmt::format("{}", rasters.front())));
  }
  Dataset dataset = try_open(rasters.front());
  if (!dataset) {
    throw IoError("cannot open the raster", rasters.front(), session.cause("GDAL refused it"),
                  "check the file with: gdalinfo " + rasters.front());
  }
  return {.dataset = std::move(dataset), .name = rasters.front(), .assumptions = {}};
}

// NetCDF and HDF5 files with several grids show no band of their own.
OpenedRaster first_subdataset(OpenedRaster container, const std::string& path) {
  GdalSession session;
  const CPLStringList list(CSLDuplicate(container.dataset->GetMetadata("SUBDATASETS")));
  for (int k = 1; list.FetchNameValue(fmt::format("SUBDATASET_{}_NAME", k).c_str()); ++k) {
    const std::string name = list.FetchNameValue(fmt::format("SUBDATASET_{}_NAME", k).c_str());
    Dataset dataset = try_open(name);
    if (!dataset || dataset->GetRasterCount() == 0) continue;
    if (dataset->GetRasterXSize() <= 1 || dataset->GetRasterYSize() <= 1) continue;
    OpenedRaster opened{.dataset = std::move(dataset), .name = name, .assumptions = {}};
    if (list.Count() > 2) {
      opened.assumptions.push_back(
          fmt::format("the file holds {} grids; {} is taken", list.Count() / 2, name));
    }
    return opened;
  }
  throw IoError("cannot read heights from", path, "it holds no raster band",
                "list what it holds with: gdalinfo " + path);
}

}  // namespace

void CloseDataset::operator()(GDALDataset* dataset) const {
  const GdalSession quiet;
  GDALClose(GDALDataset::ToHandle(dataset));
}

OpenedRaster open_dataset(const std::string& path) {
  require_no_stream(path);
  GdalSession session;
  OpenedRaster opened{.dataset = try_open(path), .name = path, .assumptions = {}};
  VSIStatBufL status;
  const bool exists = VSIStatL(path.c_str(), &status) == 0;
  if (!opened.dataset && exists && lower_extension(path) == ".zip") opened = open_in_archive(path);
  if (!opened.dataset) {
    throw IoError("cannot open the raster", path, session.cause("GDAL refused it"),
                  exists
                      ? "if it is a raster, gdalinfo must be able to read it; gdalinfo --formats "
                        "lists what this GDAL knows"
                      : "check the path");
  }
  if (opened.dataset->GetRasterCount() == 0) return first_subdataset(std::move(opened), path);
  return opened;
}

}  // namespace qmpipe
