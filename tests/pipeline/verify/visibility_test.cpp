#include "pipeline/verify/visibility.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace qmpipe::testing::visibility_test {
namespace {

double uniform(std::mt19937_64& random, double low, double high) {
  return low + (high - low) * static_cast<double>(random() >> 11U) * 0x1p-53;
}

std::vector<Vec3> grid_of(const RectangleDeg& r, double height_m, int cells = 8) {
  std::vector<Vec3> points;
  for (int j = 0; j <= cells; ++j) {
    for (int i = 0; i <= cells; ++i) {
      points.push_back(to_ecef({r.west_deg + (r.east_deg - r.west_deg) * i / cells,
                                r.south_deg + (r.north_deg - r.south_deg) * j / cells, height_m}));
    }
  }
  return points;
}

QuantizedMeshHeader header_of(const RectangleDeg& r, const std::vector<Vec3>& points, double low_m,
                              double high_m) {
  QuantizedMeshHeader header;
  header.min_height_m = static_cast<float>(low_m);
  header.max_height_m = static_cast<float>(high_m);
  header.sphere_centre_ecef_m = bounding_sphere(points).centre;
  header.horizon_occlusion_point = horizon_occlusion_point(
      to_ecef({(r.west_deg + r.east_deg) / 2, (r.south_deg + r.north_deg) / 2, 0}), points);
  return header;
}

TEST(HiddenTerrain, OurPointsHideNoTileThatIsSeen) {
  for (std::uint64_t seed = 1; seed <= 300; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const TilingScheme scheme(seed % 2 == 0 ? Projection::kGeodetic : Projection::kMercator);
    const auto zoom = static_cast<std::int32_t>(random() % 5);
    const TileKey key = {
        .zoom = zoom,
        .x = static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(scheme.columns(zoom))),
        .y = static_cast<std::int32_t>(random() % static_cast<std::uint64_t>(scheme.rows(zoom)))};
    const RectangleDeg rectangle = scheme.rectangle_deg(key);
    const double height_m = seed % 3 == 0 ? 0 : uniform(random, -500, 8800);
    const std::vector<Vec3> points = grid_of(rectangle, height_m);
    const QuantizedMeshHeader header = header_of(rectangle, points, height_m, height_m + 10);
    const auto hidden = verify::hidden_terrain(header, rectangle, points);
    EXPECT_FALSE(hidden) << to_string(key) << " at " << height_m << " m from longitude "
                         << hidden->camera.longitude_deg << ", latitude "
                         << hidden->camera.latitude_deg << ", height " << hidden->camera.height_m;
  }
}

TEST(HiddenTerrain, APointTowardsElsewhereHidesATileFromOneWhoStandsOnIt) {
  const TilingScheme scheme(Projection::kGeodetic);
  for (std::uint64_t seed = 1; seed <= 100; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const TileKey key = {.zoom = 0, .x = static_cast<std::int32_t>(seed % 2), .y = 0};
    const RectangleDeg rectangle = scheme.rectangle_deg(key);
    const std::vector<Vec3> points = grid_of(rectangle, 100);
    QuantizedMeshHeader header = header_of(rectangle, points, 100, 110);
    EXPECT_FALSE(verify::hidden_terrain(header, rectangle, points));
    // As far away as the client's arithmetic bears, but along the centre of a sphere that stands at
    // the earth's: anywhere.
    const Vec3 anywhere =
        unit({uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1)});
    header.horizon_occlusion_point = scaled(anywhere, 1e6);
    EXPECT_TRUE(verify::hidden_terrain(header, rectangle, points));
    // Below zero the client looks for a point itself, finds none, and takes the header's after all.
    header.min_height_m = -1;
    EXPECT_TRUE(verify::hidden_terrain(header, rectangle, points));
  }
}

TEST(HiddenTerrain, PeaksOnTheRimOfAHemisphereAreSeenFromTheEarthsShadow) {
  const RectangleDeg rectangle = TilingScheme(Projection::kGeodetic).rectangle_deg({0, 1, 0});
  const std::vector<Vec3> points = grid_of(rectangle, 8000);
  QuantizedMeshHeader header = header_of(rectangle, points, 8000, 8000);
  header.horizon_occlusion_point = {0, 1e6, 0};
  const auto hidden = verify::hidden_terrain(header, rectangle, points);
  ASSERT_TRUE(hidden);
  // The camera is on the other side of the rim.
  EXPECT_LT(to_ecef(hidden->camera)[1], 0);
}

TEST(HiddenTerrain, ASmallTileWhosePointLiesTooLowIsHiddenFromAbove) {
  const RectangleDeg rectangle = TilingScheme(Projection::kGeodetic).rectangle_deg({8, 300, 190});
  const std::vector<Vec3> points = grid_of(rectangle, 3000);
  QuantizedMeshHeader header = header_of(rectangle, points, 3000, 3000);
  EXPECT_FALSE(verify::hidden_terrain(header, rectangle, points));
  header.horizon_occlusion_point = scaled(header.horizon_occlusion_point, -1);
  EXPECT_TRUE(verify::hidden_terrain(header, rectangle, points));
}

}  // namespace
}  // namespace qmpipe::testing::visibility_test
