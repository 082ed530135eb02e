#include "pipeline/verify/visibility.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <vector>

#include "formats/crs/wgs84.h"
#include "scheduler/elementary.h"

namespace qmpipe::verify {
namespace {

constexpr double kWideDeg = 60;
// Above the highest vertex.
constexpr std::array<double, 5> kHeightsAboveM = {50, 3e3, 1e5, 2e6, 3e7};
// Cameras over a tile stand in the middle of so many rows and columns of it.
constexpr int kRowsOfCameras = 5;
constexpr double kCameraStepDeg = 30;
constexpr int kParallelsOfCameras = 6;
// Peaks on a rim are seen from this much farther beyond it than the rim itself.
constexpr double kBeyondHorizonDeg = 0.3;

// The client's ellipsoid: the earth, or one that is smaller by what the tile lies below it.
class Occluder {
 public:
  explicit Occluder(double smaller_by_m)
      : radii_{kEquatorialRadiusM - smaller_by_m, kEquatorialRadiusM - smaller_by_m,
               kPolarRadiusM - smaller_by_m} {}

  Vec3 in_radii(const Vec3& point) const {
    return {point[0] / radii_[0], point[1] / radii_[1], point[2] / radii_[2]};
  }

  // Word for word the client's test, with what its arithmetic does with overflows.
  static bool is_visible(const Vec3& point, const Vec3& camera) {
    const double limb_squared = dot(camera, camera) - 1;
    const Vec3 to_point = minus(point, camera);
    const double along = -dot(to_point, camera);
    const bool is_hidden =
        limb_squared < 0
            ? along > 0
            : along > limb_squared && along * along / dot(to_point, to_point) > limb_squared;
    return !is_hidden;
  }

  // The point that the client computes; none where it finds none.
  std::optional<Vec3> point_along(const Vec3& towards_ecef,
                                  std::span<const Vec3> positions_ecef) const {
    const Vec3 towards = in_radii(towards_ecef);
    if (!(length(towards) > 0)) return std::nullopt;
    const Vec3 direction = unit(towards);
    double farthest = 0;
    for (const Vec3& position : positions_ecef) {
      const Vec3 p = in_radii(position);
      const double magnitude = std::max(1.0, length(p));
      const Vec3 up = scaled(p, 1 / length(p));
      const double cos_beta = 1 / magnitude;
      const double sin_beta = std::sqrt(magnitude * magnitude - 1) * cos_beta;
      const double candidate =
          1 / (dot(up, direction) * cos_beta - length(cross(up, direction)) * sin_beta);
      if (candidate < 0) return std::nullopt;
      farthest = std::max(farthest, candidate);
    }
    if (!(farthest > 0) || std::isinf(farthest)) return std::nullopt;
    return scaled(direction, farthest);
  }

 private:
  Vec3 radii_;
};

// How far away the horizon is from this height.
double horizon_deg(double height_m) {
  const double radii = 1 + height_m / kEquatorialRadiusM;
  return atan2_deg(std::sqrt(radii * radii - 1), 1);
}

std::vector<GeoPoint> cameras_around(const RectangleDeg& rectangle, double highest_m) {
  std::vector<GeoPoint> cameras;
  const double width_deg = rectangle.east_deg - rectangle.west_deg;
  const auto add = [&](double longitude_deg, double latitude_deg) {
    for (const double above_m : kHeightsAboveM) {
      cameras.push_back({.longitude_deg = longitude_deg,
                         .latitude_deg = latitude_deg,
                         .height_m = std::max(0.0, highest_m) + above_m});
    }
  };
  for (int j = 0; j < kRowsOfCameras; ++j) {
    for (int i = 0; i < kRowsOfCameras; ++i) {
      const auto within = [](double from, double to, int k) {
        return from + (to - from) * (k + 0.5) / kRowsOfCameras;
      };
      add(within(rectangle.west_deg, rectangle.east_deg, i),
          within(rectangle.south_deg, rectangle.north_deg, j));
    }
  }
  if (width_deg <= kWideDeg) return cameras;
  for (int j = 0; j < kParallelsOfCameras; ++j) {
    for (int i = 0; i < 2 * kParallelsOfCameras; ++i) {
      add(rectangle.west_deg + i * kCameraStepDeg, (j + 0.5) * kCameraStepDeg - 90);
    }
  }
  // Where the middles of the west and east sides are on the horizon.
  const double middle_deg = (rectangle.south_deg + rectangle.north_deg) / 2;
  for (const double above_m : kHeightsAboveM) {
    const double height_m = std::max(0.0, highest_m) + above_m;
    const double beyond_deg = horizon_deg(height_m) + kBeyondHorizonDeg;
    for (const double longitude_deg :
         {rectangle.west_deg - beyond_deg, rectangle.east_deg + beyond_deg}) {
      cameras.push_back(
          {.longitude_deg = longitude_deg, .latitude_deg = middle_deg, .height_m = height_m});
    }
  }
  return cameras;
}

}  // namespace

std::optional<HiddenTerrain> hidden_terrain(const QuantizedMeshHeader& header,
                                            const RectangleDeg& rectangle,
                                            std::span<const Vec3> positions_ecef) {
  const double lowest_m = static_cast<double>(header.min_height_m);
  const bool is_shrunk = lowest_m < 0 && kPolarRadiusM > -lowest_m;
  const Occluder occluder(is_shrunk ? -lowest_m : 0);
  std::optional<Vec3> point;
  if (lowest_m < 0) point = occluder.point_along(header.sphere_centre_ecef_m, positions_ecef);
  if (!point) point = header.horizon_occlusion_point;
  std::vector<Vec3> vertices(positions_ecef.size());
  std::transform(positions_ecef.begin(), positions_ecef.end(), vertices.begin(),
                 [&](const Vec3& p) { return occluder.in_radii(p); });
  for (const GeoPoint& place : cameras_around(rectangle, header.max_height_m)) {
    const Vec3 camera = occluder.in_radii(to_ecef(place));
    if (Occluder::is_visible(*point, camera)) continue;
    const auto seen = std::find_if(vertices.begin(), vertices.end(), [&](const Vec3& vertex) {
      return Occluder::is_visible(vertex, camera);
    });
    if (seen == vertices.end()) continue;
    return HiddenTerrain{.camera = place,
                         .vertex = static_cast<std::size_t>(seen - vertices.begin())};
  }
  return std::nullopt;
}

}  // namespace qmpipe::verify
