#include "formats/raster/crs.h"

#include <cpl_string.h>
#include <gdal_priv.h>
#include <ogr_spatialref.h>

#include <array>
#include <cmath>
#include <filesystem>
#include <numbers>
#include <optional>

#include "formats/bytes/errors.h"
#include "formats/crs/beside.h"
#include "formats/crs/paths.h"
#include "formats/crs/wkt.h"
#include "formats/raster/dataset.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr char kNoCrsRemedy[] =
    "say which one it is with --source-crs EPSG:n, or write it into the file: "
    "gdal_edit.py -a_srs EPSG:n FILE, or gdal_translate -a_srs EPSG:n FILE NEW.tif";

bool begins_with(const std::string& text, const char* start) { return text.rfind(start, 0) == 0; }

// Does an axis of this name and unit count degrees, eastwards ('e') or northwards ('n')?
bool is_degree_axis(const std::string& name, const std::string& unit, char direction) {
  const bool east = direction == 'e';
  const std::array<const char*, 5> units =
      east ? std::array<const char*, 5>{"degrees_east", "degree_east", "degrees_E", "degree_E",
                                        "degreesE"}
           : std::array<const char*, 5>{"degrees_north", "degree_north", "degrees_N", "degree_N",
                                        "degreesN"};
  for (const char* known : units) {
    if (unit == known) return true;
  }
  return begins_with(name, east ? "lon" : "lat");
}

bool has_degree_axes(GDALDataset& dataset) {
  bool east = false;
  bool north = false;
  for (char** line = dataset.GetMetadata(); line != nullptr && *line != nullptr; ++line) {
    const std::string text = *line;
    const std::size_t hash = text.find('#');
    const std::size_t equals = text.find('=');
    if (hash == std::string::npos || equals == std::string::npos || hash > equals) continue;
    const std::string name = text.substr(0, hash);
    const bool is_unit = text.substr(hash + 1, equals - hash - 1) == "units";
    const std::string unit = is_unit ? text.substr(equals + 1) : "";
    east = east || is_degree_axis(name, unit, 'e');
    north = north || is_degree_axis(name, unit, 'n');
  }
  return east && north;
}

bool extent_looks_like_degrees(GDALDataset& dataset) {
  std::array<double, 6> g{};
  if (dataset.GetGeoTransform(g.data()) != CE_None) return false;
  const double east = g[0] + g[1] * dataset.GetRasterXSize();
  const double south = g[3] + g[5] * dataset.GetRasterYSize();
  const auto is_longitude = [](double x) { return x >= -181 && x <= 361; };
  const auto is_latitude = [](double y) { return y >= -90.5 && y <= 90.5; };
  return is_longitude(g[0]) && is_longitude(east) && is_latitude(g[3]) && is_latitude(south);
}

// A .prj file with the raster's or the archive's name: what shapefile-like bundles carry, and what
// GDAL does not look for outside an archive.
std::optional<fs::path> prj_beside(const std::string& path, const std::string& opened) {
  std::error_code ignored;
  const fs::path file(path);
  const fs::path folder = file.parent_path();
  for (const fs::path& stem : {fs::path(opened).stem(), file.stem()}) {
    const fs::path candidate = folder / (stem.string() + ".prj");
    if (fs::is_regular_file(candidate, ignored)) return candidate;
  }
  return std::nullopt;
}

// Why a CRS cannot place a raster, whatever the place; none where it may.
std::optional<std::string> fault_of_crs(const OGRSpatialReference& crs) {
  const std::string name = crs.GetName() != nullptr ? crs.GetName() : "unnamed";
  if (crs.IsVertical() != 0 && crs.IsCompound() == 0) {
    return "'" + name + "' is a CRS of heights alone, which says nothing about x and y";
  }
  if (crs.IsGeocentric() != 0) {
    return "'" + name + "' counts from the centre of the Earth, and a raster lies on its surface";
  }
  return std::nullopt;
}

OGRSpatialReference crs_from_text(const std::string& text) {
  OGRSpatialReference crs;
  if (crs.SetFromUserInput(text.c_str()) != OGRERR_NONE) {
    throw UsageError("--source-crs " + text +
                     " is not a CRS; write EPSG:n, a PROJ string, WKT, or the path of a .prj file");
  }
  if (const auto fault = fault_of_crs(crs)) {
    throw UsageError("--source-crs " + text + ": " + *fault +
                     "; name the one of x and y, or both: --source-crs EPSG:4326+5773");
  }
  return crs;
}

OGRSpatialReference crs_from_prj(const fs::path& prj) {
  CPLStringList lines(CSLLoad(prj.c_str()));
  std::string text;
  for (int k = 0; k < lines.Count(); ++k) text += std::string(lines[k]) + "\n";
  if (const auto named = path_in_crs(text)) refuse_path_in_crs(prj.string(), *named);
  OGRSpatialReference crs;
  if (lines.Count() == 0 || crs.importFromESRI(lines.List()) != OGRERR_NONE) {
    throw IoError("cannot use the CRS in", prj.string(), "it is no CRS that GDAL understands",
                  kNoCrsRemedy);
  }
  return crs;
}

// Empty where there is none and none is required.
OGRSpatialReference find_crs(GDALDataset& dataset, const std::string& path,
                             const std::string& opened, const std::string& override_text,
                             CrsNeed need, std::vector<std::string>& assumptions) {
  OGRSpatialReference crs;
  if (!override_text.empty()) {
    crs = crs_from_text(override_text);
  } else if (const OGRSpatialReference* own = dataset.GetSpatialRef();
             own != nullptr && !own->IsEmpty()) {
    if (const auto named = path_in_crs(wkt_of(*own))) refuse_path_in_crs(path, *named);
    if (const auto fault = fault_of_crs(*own)) {
      throw IoError("cannot place the raster", path, "its CRS " + *fault, kNoCrsRemedy);
    }
    return *own;
  } else if (const std::optional<fs::path> prj = prj_beside(path, opened)) {
    crs = crs_from_prj(*prj);
    assumptions.push_back("the file names no CRS; the one in " + prj->string() + " is taken");
  } else if (is_netcdf(dataset) && has_degree_axes(dataset) && extent_looks_like_degrees(dataset)) {
    crs.importFromEPSG(4326);
    assumptions.emplace_back(
        "the file names no CRS; its axes are longitude and latitude, so EPSG:4326"
        " (WGS84) is taken");
  } else if (need == CrsNeed::kOptional) {
    assumptions.emplace_back("the file names no CRS; its coordinates are taken as metres");
  } else {
    throw IoError("cannot place the raster", path, "it has no coordinate reference system",
                  kNoCrsRemedy);
  }
  crs.SetAxisMappingStrategy(OAMS_TRADITIONAL_GIS_ORDER);
  return crs;
}

std::array<int, 2> axes_of(const OGRSpatialReference& crs) {
  const std::vector<int>& mapping = crs.GetDataAxisToSRSAxisMapping();
  std::array<int, 2> axes = {1, 2};
  if (mapping.size() >= 2) axes = {mapping[0], mapping[1]};
  const bool is_plane = std::abs(axes[0]) + std::abs(axes[1]) == 3;
  return is_plane ? axes : std::array<int, 2>{1, 2};
}

}  // namespace

RasterCrs crs_of(GDALDataset& dataset, const std::string& path, const std::string& opened,
                 const std::string& override_text, CrsNeed need) {
  RasterCrs result;
  OGRSpatialReference crs =
      find_crs(dataset, path, opened, override_text, need, result.assumptions);
  if (crs.IsEmpty()) return result;
  result.name = crs.GetName() != nullptr ? crs.GetName() : "unnamed";
  result.vertical = vertical_crs_of(wkt_of(crs));
  result.text.axes = axes_of(crs);
  crs.StripVertical();
  if (crs.GetAxesCount() == 3) crs.DemoteTo2D(nullptr);
  result.is_geographic = crs.IsGeographic() != 0;
  OGRErr has_no_radius = OGRERR_NONE;
  const double radius_m = crs.GetSemiMajor(&has_no_radius);
  if (has_no_radius == OGRERR_NONE) result.radius_m = radius_m;
  if (result.is_geographic) {
    const double turn =
        2 * std::numbers::pi / crs.GetAngularUnits(static_cast<const char**>(nullptr));
    // GDAL's radians per degree have sixteen digits at best.
    result.turn = std::abs(turn - 360) < 1e-6 ? 360 : turn;
  } else {
    const double metres = crs.GetLinearUnits(static_cast<const char**>(nullptr));
    if (metres > 0 && std::isfinite(metres)) result.metres_per_unit = metres;
  }
  result.text.wkt = wkt_of(crs);
  return result;
}

}  // namespace qmpipe
