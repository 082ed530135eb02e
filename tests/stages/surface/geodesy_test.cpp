#include "stages/surface/geodesy.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

namespace qmpipe::geodesy_test {
namespace {

const double kPi = std::acos(-1.0);

double uniform(std::mt19937_64& random, double from, double to) {
  return from + (to - from) * (static_cast<double>(random() >> 11U) * 0x1p-53);
}

Vec3 random_direction(std::mt19937_64& random) {
  const double z = uniform(random, -1, 1);
  const double angle = uniform(random, 0, 2 * kPi);
  const double r = std::sqrt(1 - z * z);
  return {r * std::cos(angle), r * std::sin(angle), z};
}

// From ECEF back by iteration: nothing in common with to_ecef() but the ellipsoid.
GeoPoint from_ecef(const Vec3& p) {
  const double e2 = 1 - (6356752.3142451793 / 6378137.0) * (6356752.3142451793 / 6378137.0);
  const double r = std::hypot(p[0], p[1]);
  double lat = std::atan2(p[2], r * (1 - e2));
  double n = 0;
  for (int k = 0; k < 50; ++k) {
    n = 6378137.0 / std::sqrt(1 - e2 * std::sin(lat) * std::sin(lat));
    lat = std::atan2(p[2] + e2 * n * std::sin(lat), r);
  }
  const double height_m = r * std::cos(lat) + p[2] * std::sin(lat) -
                          6378137.0 * std::sqrt(1 - e2 * std::sin(lat) * std::sin(lat));
  return {std::atan2(p[1], p[0]) * 180 / kPi, lat * 180 / kPi, height_m};
}

TEST(Ecef, KnownPlaces) {
  EXPECT_EQ(to_ecef({0, 0, 0}), (Vec3{kEquatorialRadiusM, 0, 0}));
  EXPECT_EQ(to_ecef({90, 0, 100}), (Vec3{0, kEquatorialRadiusM + 100, 0}));
  EXPECT_EQ(to_ecef({180, 0, 0}), to_ecef({-180, 0, 0}));
  for (const double lon_deg : {-180.0, -77.7, 0.0, 13.0}) {
    EXPECT_EQ(to_ecef({lon_deg, 90, 0})[0], 0);
    EXPECT_NEAR(to_ecef({lon_deg, -90, 5})[2], -kPolarRadiusM - 5, 1e-8);
  }
  // EPSG guidance note 7-2, section 4.1.1.
  const Vec3 sample = to_ecef({2 + 7 / 60.0 + 46.380 / 3600, 53 + 48 / 60.0 + 33.820 / 3600, 73.0});
  EXPECT_NEAR(sample[0], 3771793.968, 0.001);
  EXPECT_NEAR(sample[1], 140253.342, 0.001);
  EXPECT_NEAR(sample[2], 5124304.349, 0.001);
}

TEST(Ecef, RoundTripsAndUpIsUp) {
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const GeoPoint point = {uniform(random, -180, 180), uniform(random, -89.9, 89.9),
                            uniform(random, -11000, 9000)};
    const GeoPoint back = from_ecef(to_ecef(point));
    ASSERT_NEAR(back.longitude_deg, point.longitude_deg, 1e-11);
    ASSERT_NEAR(back.latitude_deg, point.latitude_deg, 1e-11);
    ASSERT_NEAR(back.height_m, point.height_m, 1e-7);
    const Vec3 up = up_at(point.longitude_deg, point.latitude_deg);
    const Vec3 above = to_ecef({point.longitude_deg, point.latitude_deg, point.height_m + 1000});
    ASSERT_NEAR(length(up), 1, 1e-14);
    ASSERT_NEAR(length(minus(minus(above, to_ecef(point)), scaled(up, 1000))), 0, 1e-8);
  }
}

TEST(Geodetic, IsTheInverseOfEcefEverywhere) {
  for (std::uint64_t seed = 1; seed <= 3000; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double reach_m = seed % 3 == 0 ? 900e3 : 9e3;
    const GeoPoint point = {uniform(random, -180, 180), uniform(random, -90, 90),
                            uniform(random, -reach_m, reach_m)};
    const GeoPoint back = to_geodetic(to_ecef(point));
    EXPECT_NEAR(back.latitude_deg, point.latitude_deg, 2e-14 * 90);
    EXPECT_NEAR(back.height_m, point.height_m, 4e-9);
    EXPECT_LT(length(minus(to_ecef(back), to_ecef(point))), 5e-9);
  }
}

TEST(Geodetic, HoldsAtThePolesAndOnTheAntimeridian) {
  for (const double latitude_deg : {-90.0, 90.0}) {
    const GeoPoint pole = to_geodetic(to_ecef({77, latitude_deg, 1234.5}));
    EXPECT_EQ(pole.latitude_deg, latitude_deg);
    EXPECT_NEAR(pole.height_m, 1234.5, 2e-9);
  }
  EXPECT_EQ(to_geodetic(to_ecef({180, 0, 0})).longitude_deg, 180);
  EXPECT_EQ(to_geodetic(to_ecef({-90, 0, 0})).longitude_deg, -90);
}

TEST(Geodetic, APointMovesAlongItsVerticalToAHeight) {
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double latitude_deg = seed % 10 == 0 ? 90 : uniform(random, -90, 90);
    const GeoPoint point = {uniform(random, -180, 180), latitude_deg, uniform(random, -1e5, 1e4)};
    GeoPoint other = point;
    other.height_m = uniform(random, -9e3, 9e3);
    const Vec3 moved = moved_to_height(to_ecef(point), other.height_m);
    EXPECT_LT(length(minus(moved, to_ecef(other))), 5e-9);
  }
}

void expect_good_sphere(const std::vector<Vec3>& points, double optimal_m) {
  const Sphere sphere = bounding_sphere(points);
  for (const Vec3& p : points) ASSERT_LE(length(minus(p, sphere.centre)), sphere.radius_m);
  ASSERT_LE(sphere.radius_m, 1.05 * optimal_m + 1e-6);
}

TEST(BoundingSphere, HoldsItsPointsAndIsHardlyLargerThanNeeded) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const double radius_m = uniform(random, 1, 1e6);
    const Vec3 centre = scaled(random_direction(random), uniform(random, 0, 7e6));
    std::vector<Vec3> points;
    // A pair of opposite points makes the optimum known.
    const Vec3 axis = random_direction(random);
    points.push_back(plus(centre, scaled(axis, radius_m)));
    points.push_back(minus(centre, scaled(axis, radius_m)));
    for (std::uint64_t k = random() % 200; k > 0; --k) {
      const double inward = uniform(random, 0, 1) * radius_m;
      points.push_back(plus(centre, scaled(random_direction(random), inward)));
    }
    std::shuffle(points.begin(), points.end(), random);
    expect_good_sphere(points, radius_m);
  }
}

TEST(BoundingSphere, SimpleShapes) {
  expect_good_sphere({{1, 2, 3}}, 0);
  expect_good_sphere({{0, 0, 0}, {10, 0, 0}, {3, 0, 0}}, 5);
  std::vector<Vec3> cube;
  for (int k = 0; k < 8; ++k) {
    cube.push_back({k % 2 * 2.0 - 1, k / 2 % 2 * 2.0 - 1, k / 4 * 2.0 - 1});
  }
  expect_good_sphere(cube, std::sqrt(3.0));
  // The quarter of a globe: a root tile's patch, a hemisphere about (90 E, 0).
  std::vector<Vec3> half;
  for (double lon = 0; lon <= 180; lon += 15) {
    for (double lat = -90; lat <= 90; lat += 15) half.push_back(to_ecef({lon, lat, 0}));
  }
  expect_good_sphere(half, kEquatorialRadiusM);
}

Vec3 on_unit_sphere(const Vec3& p) {
  return {p[0] / kEquatorialRadiusM, p[1] / kEquatorialRadiusM, p[2] / kPolarRadiusM};
}

// How near the straight line from the camera to a point comes to the earth's centre, in radii: the
// point is hidden when that is less than one.
double nearest_to_centre(const Vec3& camera, const Vec3& point) {
  const Vec3 ray = minus(point, camera);
  const double t = std::clamp(-dot(camera, ray) / dot(ray, ray), 0.0, 1.0);
  return length(plus(camera, scaled(ray, t)));
}

std::vector<Vec3> random_patch(std::mt19937_64& random) {
  const double size_deg = std::exp(uniform(random, -6, 4));
  const double west_deg = uniform(random, -180, 180);
  const double south_deg = uniform(random, -90, 90 - std::min(size_deg, 90.0));
  std::vector<Vec3> points;
  for (int k = 0; k < 30; ++k) {
    points.push_back(to_ecef({west_deg + uniform(random, 0, size_deg),
                              south_deg + uniform(random, 0, std::min(size_deg, 90.0)),
                              uniform(random, 0, 8000)}));
  }
  return points;
}

TEST(HorizonOcclusion, AHiddenOcclusionPointHidesEveryVertex) {
  int hidden = 0;
  for (std::uint64_t seed = 1; seed <= 400; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const std::vector<Vec3> points = random_patch(random);
    const Vec3 occlusion = horizon_occlusion_point(bounding_sphere(points).centre, points);
    for (int k = 0; k < 200; ++k) {
      // Many cameras near the place where the point just rises above the horizon.
      const Vec3 side = random_direction(random);
      const Vec3 direction = unit(plus(unit(occlusion), scaled(side, uniform(random, 0, 3))));
      const Vec3 camera = scaled(direction, 1 + std::exp(uniform(random, -9, 3)));
      if (nearest_to_centre(camera, occlusion) >= 1 - 1e-9) continue;
      ++hidden;
      for (const Vec3& p : points) {
        ASSERT_LT(nearest_to_centre(camera, on_unit_sphere(p)), 1 + 1e-9);
      }
    }
  }
  EXPECT_GT(hidden, 10000);
}

TEST(HorizonOcclusion, IsNoFartherThanNeeded) {
  // A single point along its own ray is its own occlusion point.
  const Vec3 peak = to_ecef({10, 45, 4000});
  const Vec3 alone = horizon_occlusion_point(peak, std::vector<Vec3>{peak});
  EXPECT_NEAR(length(minus(alone, on_unit_sphere(peak))), 0, 1e-12);
  // A ring of surface points at angle a about the ray: its tangents meet at 1 / cos(a).
  std::vector<Vec3> ring;
  for (int k = 0; k < 12; ++k) {
    const double turn = k * kPi / 6;
    ring.push_back({kEquatorialRadiusM * std::cos(0.3),
                    kEquatorialRadiusM * std::sin(0.3) * std::cos(turn),
                    kPolarRadiusM * std::sin(0.3) * std::sin(turn)});
  }
  EXPECT_NEAR(length(horizon_occlusion_point({1, 0, 0}, ring)), 1 / std::cos(0.3), 1e-12);
}

TEST(HorizonOcclusion, DepthsCountAsTheSurfaceAndHalfAGlobeIsNeverHidden) {
  const Vec3 trench = to_ecef({140, 11, -10000});
  EXPECT_NEAR(length(horizon_occlusion_point(trench, std::vector<Vec3>{trench})), 1, 1e-9);
  const std::vector<Vec3> half = {to_ecef({0, 0, 0}), to_ecef({90, 0, 0}), to_ecef({180, 0, 0})};
  const Vec3 away = horizon_occlusion_point({0, 1, 0}, half);
  EXPECT_NEAR(away[1] / kNeverHiddenRadii, 1, 1e-12);
  // As good as half a globe: its rim is 0.01 degrees short of it.
  const std::vector<Vec3> nearly = {to_ecef({0.01, 0, 0}), to_ecef({179.99, 0, 0})};
  EXPECT_EQ(horizon_occlusion_point({0, 1, 0}, nearly), away);
}

}  // namespace
}  // namespace qmpipe::geodesy_test
