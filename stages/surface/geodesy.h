// WGS84 arithmetic: ECEF positions, normals, bounding spheres, horizon occlusion points.
//
// Sources: quantized-mesh SPECIFICATION (header fields); horizon occlusion after K. Ring,
// "Computing the horizon occlusion point" (Cesium, 2013). Angles in degrees in, metres out.
#pragma once

#include <span>

#include "formats/crs/wgs84.h"
#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

struct GeoPoint {
  double longitude_deg = 0;
  double latitude_deg = 0;
  double height_m = 0;  // ellipsoidal
};

Vec3 to_ecef(const GeoPoint& point);
// The inverse, for points less than 1000 km above or below the ellipsoid: good to 1e-9 m and, off
// the poles, where a meridian is as good as any other, to 1e-9 m of longitude.
GeoPoint to_geodetic(const Vec3& point_ecef);
// The point on the same vertical at this ellipsoidal height. Same bounds as to_geodetic().
Vec3 moved_to_height(const Vec3& point_ecef, double height_m);
// Unit vector that points straight up from the ellipsoid.
Vec3 up_at(double longitude_deg, double latitude_deg);

Vec3 plus(const Vec3& a, const Vec3& b);
Vec3 minus(const Vec3& a, const Vec3& b);
Vec3 scaled(const Vec3& a, double factor);
Vec3 cross(const Vec3& a, const Vec3& b);
double dot(const Vec3& a, const Vec3& b);
double length(const Vec3& a);
// REQUIRES: a is not zero.
Vec3 unit(const Vec3& a);

struct Sphere {
  Vec3 centre{};
  double radius_m = 0;
};

// A sphere that holds every point (at most about 5 % larger than the smallest one: Ritter's, then
// improved). REQUIRES: at least one point.
Sphere bounding_sphere(std::span<const Vec3> points_ecef);

// A point so far out that clients never find it hidden: see horizon_occlusion_point().
inline constexpr double kNeverHiddenRadii = 1e160;

// The point, in units of the ellipsoid's radii, on the ray from the earth's centre through
// `direction_ecef` (the middle of a tile's rectangle) that is hidden by the ellipsoid only when all
// the given points are. Where no such point exists (a tile that goes half round the globe), or none
// within 1000 radii, the ray's point at kNeverHiddenRadii. Any that is nearer would be hidden in the
// earth's shadow, from where peaks on the tile's rim are still seen; there, CesiumJS's square of its
// distance overflows, and a point that it cannot judge is visible.
// REQUIRES: direction_ecef is not zero.
Vec3 horizon_occlusion_point(const Vec3& direction_ecef, std::span<const Vec3> points_ecef);

// How far along its ray a single point pushes the occlusion point; infinity where it cannot be
// hidden along this ray. The occlusion point's distance is the largest over all points.
double occlusion_magnitude(const Vec3& unit_direction_scaled, const Vec3& point_ecef);

}  // namespace qmpipe
