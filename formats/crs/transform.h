// From longitude and latitude (WGS84) to the plane of one CRS and back, through PROJ.
//
// Guarantees: forward() and inverse() are pure functions of the point. PROJ knows several
// operations between two datums and would choose anew for each point or batch; here one is chosen
// on making, for the given extent, and kept: the best-ranked of those that reach the most of it. An
// object is used by one thread at a time; separate objects are independent.
#pragma once

#include <array>
#include <memory>
#include <optional>
#include <span>
#include <string>

namespace qmpipe {

struct LonLat {
  double longitude_deg = 0;
  double latitude_deg = 0;
};

// In the CRS's own units, in the order in which the raster's geotransform gives them.
struct MapPoint {
  double x = 0;
  double y = 0;
};

struct CrsText {
  std::string wkt;
  // Which CRS axis x and y are: 1-based, negative when reversed (GDAL's data axis mapping).
  std::array<int, 2> axes = {1, 2};
};

class CrsTransform {
 public:
  // `extent` are points of the raster's extent. None where PROJ knows no way that reaches a single
  // one of them from the globe (a local CRS, a wrong CRS). Throws IoError where the database of PROJ
  // cannot be read, for want of memory or of its file.
  static std::unique_ptr<CrsTransform> make(const CrsText& crs, std::span<const MapPoint> extent);
  // How far once round the globe is along x, in the CRS's unit, where a place's x depends on its
  // longitude alone and evenly so (Mercator, equirectangular and other cylindrical projections, not
  // transverse ones): places at x and x plus a turn are then the same. 0 for all other projected CRSs.
  static double turn_along_x(const CrsText& crs);
  ~CrsTransform();
  CrsTransform(const CrsTransform&) = delete;
  CrsTransform& operator=(const CrsTransform&) = delete;

  std::optional<MapPoint> forward(const LonLat& point) const;
  std::optional<LonLat> inverse(const MapPoint& point) const;
  // PROJ's description of the operation, for reports.
  const std::string& name() const;
  // True when PROJ knows nothing between the two datums and takes them as one.
  bool is_ballpark() const;

 private:
  struct Impl;
  explicit CrsTransform(std::unique_ptr<Impl> impl);
  std::unique_ptr<Impl> impl_;
};

}  // namespace qmpipe
