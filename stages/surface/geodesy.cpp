#include "stages/surface/geodesy.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr int kSphereSteps = 16;
constexpr int kSphereFirstStep = 8;
// A finite occlusion point farther out than this is that of a tile whose rim is as good as 90 degrees
// away.
constexpr double kFarthestRadii = 1e3;

// The latitude and height of a point, from its distance to the axis and its z.
struct Vertical {
  SinCos latitude;
  double height_m = 0;
};

// B. R. Bowring, "Transformation from spatial to geographical coordinates" (1976): Newton's method
// for the reduced latitude, of which the third step changes no digit.
Vertical vertical_through(double axis_m, double z_m) {
  constexpr double kRatio = kPolarRadiusM / kEquatorialRadiusM;
  constexpr double kE2 = 1 - kRatio * kRatio;
  const auto direction = [](double sin_part, double cos_part) {
    const double n = std::sqrt(sin_part * sin_part + cos_part * cos_part);
    return n > 0 ? SinCos{sin_part / n, cos_part / n} : SinCos{0, 1};
  };
  SinCos reduced = direction(z_m, kRatio * axis_m);
  SinCos latitude{};
  for (int step = 0; step < 3; ++step) {
    latitude =
        direction(z_m + kE2 / kRatio * kEquatorialRadiusM * reduced.sin * reduced.sin * reduced.sin,
                  axis_m - kE2 * kEquatorialRadiusM * reduced.cos * reduced.cos * reduced.cos);
    reduced = direction(kRatio * latitude.sin, latitude.cos);
  }
  const double foot = std::sqrt(1 - kE2 * latitude.sin * latitude.sin);
  return {.latitude = latitude,
          .height_m = axis_m * latitude.cos + z_m * latitude.sin - kEquatorialRadiusM * foot};
}

const Vec3& farthest_from(const Vec3& centre, std::span<const Vec3> points) {
  const Vec3* farthest = &points.front();
  double largest = -1;
  for (const Vec3& p : points) {
    const Vec3 d = minus(p, centre);
    const double squared = dot(d, d);
    if (squared <= largest) continue;
    largest = squared;
    farthest = &p;
  }
  return *farthest;
}

double radius_around(const Vec3& centre, std::span<const Vec3> points) {
  return length(minus(farthest_from(centre, points), centre));
}

Vec3 ritter_centre(std::span<const Vec3> points) {
  const Vec3 a = farthest_from(points.front(), points);
  const Vec3 b = farthest_from(a, points);
  Sphere sphere{.centre = scaled(plus(a, b), 0.5), .radius_m = length(minus(a, b)) / 2};
  for (const Vec3& p : points) {
    const double d = length(minus(p, sphere.centre));
    if (d <= sphere.radius_m) continue;
    const double radius = (sphere.radius_m + d) / 2;
    sphere.centre = plus(sphere.centre, scaled(minus(p, sphere.centre), (d - radius) / d));
    sphere.radius_m = radius;
  }
  return sphere.centre;
}

Vec3 box_centre(std::span<const Vec3> points) {
  Vec3 low = points.front();
  Vec3 high = points.front();
  for (const Vec3& p : points) {
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  return scaled(plus(low, high), 0.5);
}

// Steps towards the farthest point, shorter and shorter; keeps the best sphere on the way (Badoiu
// and Clarkson, "Smaller core-sets for balls", 2003, begun from a good centre).
Sphere improved_sphere(Vec3 centre, std::span<const Vec3> points) {
  Sphere best{.centre = centre, .radius_m = std::numeric_limits<double>::infinity()};
  for (int k = 0; k < kSphereSteps; ++k) {
    const Vec3 to_farthest = minus(farthest_from(centre, points), centre);
    const double radius_m = length(to_farthest);
    if (radius_m < best.radius_m) best = {.centre = centre, .radius_m = radius_m};
    centre = plus(centre, scaled(to_farthest, 1.0 / (k + kSphereFirstStep)));
  }
  return best;
}

}  // namespace

Vec3 plus(const Vec3& a, const Vec3& b) { return {a[0] + b[0], a[1] + b[1], a[2] + b[2]}; }
Vec3 minus(const Vec3& a, const Vec3& b) { return {a[0] - b[0], a[1] - b[1], a[2] - b[2]}; }
Vec3 scaled(const Vec3& a, double factor) { return {a[0] * factor, a[1] * factor, a[2] * factor}; }
Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]};
}
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
double length(const Vec3& a) { return std::sqrt(dot(a, a)); }
Vec3 unit(const Vec3& a) {
  const double n = length(a);
  QMPIPE_ASSERT(n > 0);
  return scaled(a, 1 / n);
}

Vec3 up_at(double longitude_deg, double latitude_deg) {
  const SinCos lon = sin_cos_deg(longitude_deg);
  const SinCos lat = sin_cos_deg(latitude_deg);
  return {lat.cos * lon.cos, lat.cos * lon.sin, lat.sin};
}

Vec3 to_ecef(const GeoPoint& point) {
  const Vec3 up = up_at(point.longitude_deg, point.latitude_deg);
  constexpr double kA2 = kEquatorialRadiusM * kEquatorialRadiusM;
  constexpr double kB2 = kPolarRadiusM * kPolarRadiusM;
  // The point of the ellipsoid whose normal is `up`: (a2 x, a2 y, b2 z) / |(a x, a y, b z)|.
  const double gamma = std::sqrt(kA2 * (up[0] * up[0] + up[1] * up[1]) + kB2 * up[2] * up[2]);
  return {(kA2 / gamma + point.height_m) * up[0], (kA2 / gamma + point.height_m) * up[1],
          (kB2 / gamma + point.height_m) * up[2]};
}

GeoPoint to_geodetic(const Vec3& point_ecef) {
  const auto& [x, y, z] = point_ecef;
  const Vertical vertical = vertical_through(std::sqrt(x * x + y * y), z);
  return {.longitude_deg = atan2_deg(y, x),
          .latitude_deg = atan2_deg(vertical.latitude.sin, vertical.latitude.cos),
          .height_m = vertical.height_m};
}

Vec3 moved_to_height(const Vec3& point_ecef, double height_m) {
  const auto& [x, y, z] = point_ecef;
  const double axis_m = std::sqrt(x * x + y * y);
  const Vertical vertical = vertical_through(axis_m, z);
  const double up_m = height_m - vertical.height_m;
  const double outwards = axis_m > 0 ? 1 + up_m * vertical.latitude.cos / axis_m : 1;
  return {x * outwards, y * outwards, z + up_m * vertical.latitude.sin};
}

Sphere bounding_sphere(std::span<const Vec3> points_ecef) {
  QMPIPE_CHECK(!points_ecef.empty());
  const Vec3 ritter = ritter_centre(points_ecef);
  const Vec3 box = box_centre(points_ecef);
  const bool box_is_better = radius_around(box, points_ecef) < radius_around(ritter, points_ecef);
  Sphere sphere = improved_sphere(box_is_better ? box : ritter, points_ecef);
  // No rounding may leave a point outside: not ours, nor that of others, who compute a point of the
  // Earth to some nanometres; on the smallest tiles the first alone would be less than that.
  sphere.radius_m = sphere.radius_m * (1 + 1e-12) + 1e-8;
  return sphere;
}

double occlusion_magnitude(const Vec3& unit_direction_scaled, const Vec3& point_ecef) {
  const Vec3 p = {point_ecef[0] / kEquatorialRadiusM, point_ecef[1] / kEquatorialRadiusM,
                  point_ecef[2] / kPolarRadiusM};
  // Points below the ellipsoid count as on it, as in the clients.
  const double magnitude_squared = std::max(1.0, dot(p, p));
  const double magnitude = std::sqrt(magnitude_squared);
  const Vec3 direction = unit(p);
  const double cos_alpha = dot(direction, unit_direction_scaled);
  const double sin_alpha = length(cross(direction, unit_direction_scaled));
  const double cos_beta = 1 / magnitude;
  const double sin_beta = std::sqrt(magnitude_squared - 1) * cos_beta;
  const double denominator = cos_alpha * cos_beta - sin_alpha * sin_beta;
  if (denominator <= 0) return std::numeric_limits<double>::infinity();
  return 1 / denominator;
}

Vec3 horizon_occlusion_point(const Vec3& direction_ecef, std::span<const Vec3> points_ecef) {
  QMPIPE_CHECK(length(direction_ecef) > 0);
  const Vec3 direction =
      unit({direction_ecef[0] / kEquatorialRadiusM, direction_ecef[1] / kEquatorialRadiusM,
            direction_ecef[2] / kPolarRadiusM});
  double magnitude = 0;
  for (const Vec3& p : points_ecef) {
    magnitude = std::max(magnitude, occlusion_magnitude(direction, p));
  }
  return scaled(direction, magnitude <= kFarthestRadii ? magnitude : kNeverHiddenRadii);
}

}  // namespace qmpipe
