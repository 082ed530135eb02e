#include "formats/raster/dataset.h"

#include <cpl_string.h>
#include <cpl_vsi.h>
#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <filesystem>
#include <optional>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/letter_case.h"
#include "formats/crs/beside.h"
#include "formats/crs/gdal_session.h"
#include "formats/raster/height_claim.h"
#include "formats/raster/height_options.h"

namespace qmpipe {
namespace {

using Dataset = std::unique_ptr<GDALDataset, CloseDataset>;

constexpr unsigned kOpenFlags = GDAL_OF_RASTER | GDAL_OF_READONLY | GDAL_OF_VERBOSE_ERROR;

Dataset try_open(const std::string& name, const std::vector<std::string>& open_options) {
  CPLStringList options;
  for (const std::string& option : open_options) options.AddString(option.c_str());
  return Dataset(GDALDataset::FromHandle(
      GDALOpenEx(name.c_str(), kOpenFlags, nullptr, options.List(), nullptr)));
}

std::string lower_extension(const std::string& path) {
  return lower_case(std::filesystem::path(path).extension().string());
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

// That a name such as NETCDF:"a.nc":z or GTIFF_DIR:2:a.tif is about.
std::string file_of_name(const std::string& name) {
  const std::size_t first = name.find('"');
  const std::size_t last = name.rfind('"');
  if (first != last) return name.substr(first + 1, last - first - 1);
  if (name.starts_with("/vsi")) return name;
  VSIStatBufL status;
  std::string rest = name;
  while (VSIStatL(rest.c_str(), &status) != 0) {
    const std::size_t colon = rest.find(':');
    if (colon == std::string::npos) return name;
    rest.erase(0, colon + 1);
  }
  return rest;
}

OpenedRaster open_in_archive(const std::string& path,
                             const std::vector<std::string>& open_options) {
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
  require_no_path_in_crs(rasters.front());
  Dataset dataset = try_open(rasters.front(), open_options);
  if (!dataset) {
    throw IoError("cannot open the raster", rasters.front(), session.cause("GDAL refused it"),
                  "check the file with: gdalinfo " + rasters.front());
  }
  OpenedRaster opened;
  opened.dataset = std::move(dataset);
  opened.name = rasters.front();
  return opened;
}

// NetCDF and HDF5 files with several grids show no band of their own.
OpenedRaster subdataset_of(const OpenedRaster& container, const std::string& path,
                           const std::vector<std::string>& open_options) {
  constexpr int kMostOpened = 100;
  GdalSession session;
  const CPLStringList list(CSLDuplicate(container.dataset->GetMetadata("SUBDATASETS")));
  OpenedRaster best;
  HeightClaim claim;
  std::vector<std::string> names;
  for (int k = 1; k <= kMostOpened; ++k) {
    const char* const name = list.FetchNameValue(fmt::format("SUBDATASET_{}_NAME", k).c_str());
    if (name == nullptr) break;
    Dataset dataset = try_open(name, open_options);
    if (!dataset || dataset->GetRasterCount() == 0) continue;
    if (dataset->GetRasterXSize() <= 1 || dataset->GetRasterYSize() <= 1) continue;
    names.emplace_back(name);
    const HeightClaim its = height_claim_of(*dataset->GetRasterBand(1), name);
    if (best.dataset && its.weight <= claim.weight) continue;
    claim = its;
    best.dataset = std::move(dataset);
    best.name = name;
  }
  if (!best.dataset) {
    throw IoError("cannot read heights from", path, "it holds no raster band",
                  "list what it holds with: gdalinfo " + path);
  }
  if (names.size() > 1) {
    const std::string& other = names[names.front() == best.name ? 1 : 0];
    best.assumptions.push_back(fmt::format(
        "the file holds {} grids; {} is taken{}; to take another, name it as the input, such as "
        "'{}'",
        names.size(), best.name, claim.reason.empty() ? "" : ", since " + claim.reason, other));
  }
  return best;
}

// The file and the variable of a NetCDF raster.
struct NetcdfVariable {
  std::string file;
  std::string name;
};

std::optional<NetcdfVariable> variable_of(GDALDataset& dataset, const std::string& name) {
  const char* const variable = dataset.GetRasterBand(1)->GetMetadataItem("NETCDF_VARNAME");
  if (variable == nullptr) return std::nullopt;
  // NETCDF:"a.nc":variable, or the path.
  const std::size_t first = name.find('"');
  const std::size_t last = name.rfind('"');
  const bool is_quoted = name.starts_with("NETCDF:") && first != last;
  return NetcdfVariable{is_quoted ? name.substr(first + 1, last - first - 1) : name, variable};
}

// Where GDAL's classic driver finds no place, for axes that no CRS explains, it also turns rows round
// by a guess. Read by its axes, an array lies as they say.
void place_by_axes(OpenedRaster& opened) {
  const auto variable = variable_of(*opened.dataset, opened.name);
  if (!variable) return;
  const Dataset file(GDALDataset::FromHandle(GDALOpenEx(variable->file.c_str(),
                                                        GDAL_OF_MULTIDIM_RASTER | GDAL_OF_READONLY,
                                                        nullptr, nullptr, nullptr)));
  const auto root = file ? file->GetRootGroup() : nullptr;
  if (!root) return;
  const std::string full_name =
      variable->name.starts_with('/') ? variable->name : "/" + variable->name;
  const auto array = root->OpenMDArrayFromFullname(full_name);
  if (!array || array->GetDimensionCount() != 2) return;
  Dataset placed(array->AsClassicDataset(1, 0));
  if (!placed || placed->GetRasterCount() != 1 || !has_geotransform(*placed)) return;
  opened.earlier_files = files_of(opened);
  opened.dataset = std::move(placed);
}

void note_open_options(const std::vector<std::string>& open_options, OpenedRaster& opened) {
  GDALDriver* const driver = opened.dataset->GetDriver();
  if (driver == nullptr) return;
  const char* const list = driver->GetMetadataItem(GDAL_DMD_OPENOPTIONLIST);
  const std::string known = list != nullptr ? list : "";
  for (const std::string& option : open_options) {
    const std::string name = option_name(option);
    if (known.find("name='" + name + "'") != std::string::npos ||
        known.find("name=\"" + name + "\"") != std::string::npos) {
      continue;
    }
    opened.assumptions.push_back(fmt::format(
        "its driver {} knows no open option {}, which is ignored", opened.driver, name));
  }
}

// A BAG of variable resolution opens as the coarse grid that all have.
void note_finer_grid(const std::vector<std::string>& open_options, OpenedRaster& opened) {
  const char* const finer = opened.dataset->GetMetadataItem("HAS_SUPERGRIDS");
  if (finer == nullptr || std::string(finer) != "TRUE") return;
  if (has_option(open_options, "MODE")) return;
  const char* const cell = opened.dataset->GetMetadataItem("MIN_RESOLUTION_X");
  opened.assumptions.push_back(
      fmt::format("it has grids of finer resolution, and the coarse one is taken; for cells of {} "
                  "m, the finest: "
                  "--oo MODE=RESAMPLED_GRID (for others: --oo RESX=M --oo RESY=M too)",
                  cell != nullptr ? cell : "less"));
}

}  // namespace

void CloseDataset::operator()(GDALDataset* dataset) const {
  const GdalSession quiet;
  GDALClose(GDALDataset::ToHandle(dataset));
}

bool is_netcdf(GDALDataset& dataset) {
  GDALDriver* const driver = dataset.GetDriver();
  return driver != nullptr && std::string(driver->GetDescription()) == "netCDF";
}

bool has_geotransform(GDALDataset& dataset) {
  std::array<double, 6> g{};
  return dataset.GetGeoTransform(g.data()) == CE_None &&
         g != std::array<double, 6>{0, 1, 0, 0, 0, 1};
}

std::vector<std::string> files_of(const OpenedRaster& opened) {
  std::vector<std::string> files = opened.earlier_files;
  const CPLStringList own(opened.dataset->GetFileList());
  for (int k = 0; k < own.size(); ++k) files.emplace_back(own[k]);
  return files;
}

OpenedRaster open_dataset(const std::string& path, const std::vector<std::string>& open_options) {
  require_no_stream(path);
  GdalSession session;
  OpenedRaster opened;
  opened.dataset = try_open(path, open_options);
  opened.name = path;
  VSIStatBufL status;
  const bool exists = VSIStatL(path.c_str(), &status) == 0;
  if (!opened.dataset && exists && lower_extension(path) == ".zip") {
    opened = open_in_archive(path, open_options);
  }
  if (!opened.dataset) {
    throw IoError("cannot open the raster", path, session.cause("GDAL refused it"),
                  exists
                      ? "if it is a raster, gdalinfo must be able to read it; gdalinfo --formats "
                        "lists what this GDAL knows"
                      : "check the path");
  }
  if (opened.dataset->GetRasterCount() == 0) opened = subdataset_of(opened, path, open_options);
  if (const GDALDriver* driver = opened.dataset->GetDriver()) {
    opened.driver = driver->GetDescription();
  }
  note_open_options(open_options, opened);
  note_finer_grid(open_options, opened);
  if (is_netcdf(*opened.dataset) && !has_geotransform(*opened.dataset) &&
      opened.dataset->GetGCPCount() == 0) {
    place_by_axes(opened);
  }
  return opened;
}

OpenedRaster open_new_dataset(const std::string& path,
                              const std::vector<std::string>& open_options) {
  const std::string file = file_of_name(path);
  require_no_path_in_crs(file);
  OpenedRaster opened = open_dataset(path, open_options);
  if (opened.driver != "VRT") return opened;
  // Not yet open: that they are when they are read.
  for (const std::string& part : files_of(opened)) {
    if (part != file) require_no_path_in_crs(part);
  }
  return opened;
}

}  // namespace qmpipe
