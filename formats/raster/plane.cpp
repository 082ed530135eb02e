#include "formats/raster/plane.h"

#include <fmt/format.h>
#include <gdal_priv.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "formats/bytes/errors.h"
#include "formats/raster/dataset.h"

namespace qmpipe {
namespace {

// Longitudes may be counted from anywhere, and a grid that is a bit off reaches over the poles, which is
// told of pixel by pixel.
constexpr double kLargestLongitudeDeg = 540;
constexpr double kLargestLatitudeDeg = 100;
// All ellipsoids and spheres that were ever used for Earth, and no other body's.
constexpr double kLeastEarthRadiusM = 6.3e6;
constexpr double kLargestEarthRadiusM = 6.45e6;

constexpr char kWriteBounds[] =
    "write the bounds into it: gdal_translate -a_ullr WEST NORTH EAST SOUTH FILE NEW.tif";
// Without axes GDAL can but guess.
constexpr char kNetcdfRows[] =
    " (where the first row is the northernmost, and not the southernmost as GDAL takes it: "
    "gdal_translate --config GDAL_NETCDF_BOTTOMUP NO ...)";

}  // namespace

void require_no_points(GDALDataset& dataset, const std::string& path) {
  if (has_geotransform(dataset)) return;
  const auto refuse = [&path](const char* cause, const char* options) {
    throw IoError("cannot place the raster", path, cause,
                  fmt::format("make one on a grid, with voids where it does not reach: gdalwarp {}"
                              "-t_srs EPSG:4326 -ot Float32 -dstnodata -9999 FILE NEW.tif",
                              options));
  };
  if (dataset.GetGCPCount() > 0) {
    const OGRSpatialReference* const crs = dataset.GetGCPSpatialRef();
    refuse("it has ground control points, but no geotransform",
           crs != nullptr && !crs->IsEmpty() ? "" : "-s_srs EPSG:n ");
  }
  if (dataset.GetMetadata("GEOLOCATION") != nullptr) {
    refuse("it has a place for each pixel (geolocation arrays), but no geotransform", "-geoloc ");
  }
  if (dataset.GetMetadata("RPC") != nullptr) {
    refuse("it has a camera model (RPC), but no geotransform", "-rpc ");
  }
}

std::optional<PixelPlane> plane_of(GDALDataset& dataset, const std::string& path, CrsNeed need) {
  std::array<double, 6> g{};
  dataset.GetGeoTransform(g.data());
  if (!has_geotransform(dataset)) {
    if (need == CrsNeed::kOptional) return std::nullopt;
    throw IoError("cannot place the raster", path,
                  "it has no geotransform: nothing says where its pixels lie",
                  std::string(kWriteBounds) + (is_netcdf(dataset) ? kNetcdfRows : ""));
  }
  const PixelPlane plane{.x0 = g[0],
                         .x_per_column = g[1],
                         .x_per_row = g[2],
                         .y0 = g[3],
                         .y_per_column = g[4],
                         .y_per_row = g[5]};
  const double area = plane.determinant();
  if (!std::isfinite(area) || area == 0 || !std::isfinite(g[0]) || !std::isfinite(g[3])) {
    throw IoError("cannot place the raster", path,
                  fmt::format("its geotransform ({}) cannot be inverted", fmt::join(g, ", ")),
                  kWriteBounds);
  }
  return plane;
}

bool is_of_earth_size(const RasterCrs& crs) {
  return crs.radius_m == 0 ||
         (crs.radius_m >= kLeastEarthRadiusM && crs.radius_m <= kLargestEarthRadiusM);
}

void require_earth(const RasterCrs& crs, const std::string& path, Placing placing) {
  if (is_of_earth_size(crs)) return;
  const std::string what = fmt::format(
      "its CRS '{}' is of another body, with a radius of {:.10g} m", crs.name, crs.radius_m);
  if (placing == Placing::kGlobe) {
    throw IoError(
        "cannot make tiles of", path,
        what + ", and tiles lie on Earth, where viewers would draw them",
        "make a TIN of it in the plane of its own projection: qmpipe tin FILE -o NEW.ply");
  }
  if (!crs.is_geographic) return;
  throw IoError("cannot measure lengths on", path,
                what + ", and in degrees, which are measured on Earth",
                fmt::format("project it onto its own body: gdalwarp -t_srs \"+proj=eqc +R={:.10g} "
                            "+units=m\" FILE NEW.tif",
                            crs.radius_m));
}

void require_degrees(const GridInfo& grid, const RasterCrs& crs, const std::string& path,
                     const std::string& override_text) {
  if (!crs.is_geographic) return;
  const double degrees = 360 / crs.turn;
  double x_deg = 0;
  double y_deg = 0;
  for (const double column : {0.5, static_cast<double>(grid.width) - 0.5}) {
    for (const double row : {0.5, static_cast<double>(grid.height) - 0.5}) {
      const MapPoint at = grid.plane.map_of({.column = column, .row = row});
      x_deg = std::max(x_deg, std::abs(at.x) * degrees);
      y_deg = std::max(y_deg, std::abs(at.y) * degrees);
    }
  }
  if (x_deg <= kLargestLongitudeDeg && y_deg <= kLargestLatitudeDeg) return;
  const std::string cause = fmt::format(
      "its coordinates reach x {:.10g} and y {:.10g}, which are no degrees of longitude and "
      "latitude",
      x_deg / degrees, y_deg / degrees);
  const char* const remedy = "name the CRS that they are in, such as --source-crs EPSG:32632";
  if (override_text.empty()) throw IoError("cannot place the raster", path, cause, remedy);
  throw UsageError(fmt::format("--source-crs {}: {}: {}; {}", override_text, path, cause, remedy));
}

}  // namespace qmpipe
