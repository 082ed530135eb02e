// What verify says of a whole set: nothing of a sound one, everything it should count of others.
#include "pipeline/verify/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "formats/bytes/errors.h"
#include "pipeline/verify/tile.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::testing::verify_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

TEST(Verify, FindsNothingInASoundSet) {
  const SetFixture set(sixteen_tiles());
  const verify::VerifyReport report = set.verify();
  EXPECT_THAT(report.faults, IsEmpty()) << text_of(report);
  EXPECT_THAT(report.warnings, IsEmpty()) << text_of(report);
  EXPECT_EQ(report.tiles, 16);
  EXPECT_LT(report.largest_crack_m, 1e-3);
  ASSERT_EQ(report.zooms.size(), 4U);
  // Zoom 0: east of each root. Zoom 1: four pairs in each row, four between them. Zoom 2: two pairs
  // side by side, two above each other, one across the antimeridian.
  EXPECT_EQ(report.zooms[0].borders, 2);
  EXPECT_EQ(report.zooms[1].borders, 12);
  EXPECT_EQ(report.zooms[2].borders, 5);
  EXPECT_EQ(report.zooms[3].borders, 0);
  EXPECT_THAT(text_of(report), HasSubstr("verify: 16 tiles, 0 faults, largest crack "));
}

TEST(Verify, ComparesTheMercatorRootWithItself) {
  SetPlan plan;
  plan.scheme = TilingScheme(Projection::kMercator);
  plan.keys = {{.zoom = 0, .x = 0, .y = 0}};
  plan.heights = smooth_globe(plan.scheme);
  const SetFixture set(plan);
  EXPECT_THAT(set.fault_kinds(), IsEmpty()) << text_of(set.verify());
  EXPECT_EQ(set.verify().zooms.front().borders, 1);
  sink_side(set, plan.keys.front(), Side::kEast);
  EXPECT_THAT(set.fault_kinds(), ElementsAre("crack"));
}

TEST(Verify, RefusesTilesBeyondTheScheme) {
  SetPlan plan;
  plan.scheme = TilingScheme(Projection::kMercator);
  plan.keys = {{.zoom = 0, .x = 0, .y = 0}};
  plan.heights = smooth_globe(plan.scheme);
  const SetFixture set(plan);
  std::filesystem::create_directories(set.path() / "0/1");
  std::filesystem::copy_file(set.path() / "0/0/0.terrain", set.path() / "0/1/0.terrain");
  EXPECT_THAT(set.fault_kinds(), ElementsAre("outside-scheme"));
}

TEST(Verify, TellsTheWholeCrackAndWhereItIs) {
  const SetFixture set(sixteen_tiles());
  set.change(kWestTile, [](QuantizedMesh& mesh) { mesh.h[vertex_on_side(mesh, Side::kEast)] = 0; });
  const verify::VerifyReport report = set.verify();
  ASSERT_EQ(report.faults.size(), 1U);
  EXPECT_EQ(report.faults[0].key, kWestTile);
  EXPECT_THAT(report.faults[0].text, HasSubstr("east side against 2/1/2"));
  EXPECT_GT(report.largest_crack_m, 1);
  EXPECT_EQ(report.largest_crack_m, report.zooms[2].largest_crack_m);
}

TEST(Verify, WarnsWithoutCallingItAFault) {
  const SetFixture set(sixteen_tiles());
  set.change(kLeaf, [](QuantizedMesh& mesh) {
    mesh.header.sphere_radius_m *= 2;
    for (std::uint16_t& h : mesh.h) h = static_cast<std::uint16_t>(h / 4);
  });
  EXPECT_THAT(set.fault_kinds(), IsEmpty()) << text_of(set.verify());
  EXPECT_THAT(set.warning_kinds(), ElementsAre("loose-height-range", "oversized-sphere"));
  set.replace_in_layer("\"bounds\"", "\"limits\"");
  EXPECT_THAT(set.warning_kinds(),
              ElementsAre("layer-json-advice", "loose-height-range", "oversized-sphere"));
}

TEST(Verify, JudgesAnUnreadOcclusionPointMildlyInAnotherProgramsTile) {
  const SetFixture set(sixteen_tiles());
  set.change(kLeaf, [](QuantizedMesh& mesh) {
    const float down_m = mesh.header.min_height_m + 1;
    mesh.header.min_height_m -= down_m;
    mesh.header.max_height_m -= down_m;
    for (double& c : mesh.header.horizon_occlusion_point) c *= 0.9;
    mesh.header.sphere_radius_m += static_cast<double>(down_m);
  });
  EXPECT_THAT(set.fault_kinds(), IsEmpty()) << text_of(set.verify());
  EXPECT_THAT(set.warning_kinds(), ElementsAre("occlusion-ignored"));
}

TEST(Verify, TakesASetThatStartsAtADeeperZoom) {
  const SetFixture set(sixteen_tiles());
  set.change_layer([](LayerJson& layer) {
    layer.min_zoom = 2;
    layer.available[0].clear();
    layer.available[1].clear();
  });
  std::filesystem::remove_all(set.path() / "0");
  std::filesystem::remove_all(set.path() / "1");
  EXPECT_THAT(set.fault_kinds(), IsEmpty()) << text_of(set.verify());
}

TEST(Verify, CountsAGlobeOfListedTilesWithoutWalkingIt) {
  const SetFixture set(sixteen_tiles());
  constexpr std::int32_t kColumns = 2 << kMaxZoom;
  constexpr std::int32_t kRows = 1 << kMaxZoom;
  set.change_layer([](LayerJson& layer) {
    layer.max_zoom = kMaxZoom;
    layer.available.resize(kMaxZoom + 1);
    // They overlap, and leave out the northernmost row.
    layer.available[kMaxZoom] = {{0, 0, kColumns - 1, kRows / 2}, {0, 5, kColumns - 1, kRows - 2}};
  });
  const verify::VerifyReport report = set.verify();
  ASSERT_EQ(report.faults.size(), 1U);
  const std::int64_t listed = std::int64_t{kColumns} * (kRows - 1);
  const std::string zoom = std::to_string(kMaxZoom);
  EXPECT_THAT(report.faults[0].text, HasSubstr(std::to_string(listed) + " tiles of zoom " + zoom));
  EXPECT_THAT(report.faults[0].text, HasSubstr(zoom + "/0/0, " + zoom + "/1/0, "));
}

TEST(Verify, CountsAllFaultsAndShowsTheFirst) {
  const SetFixture set(sixteen_tiles());
  for (std::int32_t x = 0; x < 4; ++x) {
    set.change({.zoom = 1, .x = x, .y = 1}, [](QuantizedMesh& mesh) {
      std::swap(mesh.indices[0], mesh.indices[1]);
      std::swap(mesh.indices[3], mesh.indices[4]);
    });
  }
  const verify::VerifyReport report = set.verify({.most_per_kind = 2});
  EXPECT_EQ(report.fault_count, 4);
  ASSERT_EQ(report.faults.size(), 2U);
  EXPECT_THAT(report.faults[0].text, HasSubstr("2 of "));
  EXPECT_THAT(text_of(report), HasSubstr("fault clockwise-triangle: 2 more not shown"));
  EXPECT_THAT(json_of(report), HasSubstr("\"clockwise-triangle\": 4"));
}

TEST(Verify, SaysTheSameOnAnyNumberOfThreads) {
  const SetFixture set(sixteen_tiles());
  sink_side(set, kLeafParent, Side::kWest);
  sink_side(set, kBeforeAntimeridian, Side::kEast);
  set.change(kLeaf, [](QuantizedMesh& mesh) { std::swap(mesh.indices[3], mesh.indices[4]); });
  const std::string expected = json_of(set.verify({.threads = 1}));
  for (const std::int32_t threads : {2, 4, 8}) {
    EXPECT_EQ(json_of(set.verify({.threads = threads})), expected) << threads << " threads";
  }
}

TEST(Verify, EndsWithFindingsWhateverTheBytes) {
  const SetFixture set(sixteen_tiles());
  const auto sound = encode(set.read(kLeaf));
  const TilingScheme scheme(Projection::kGeodetic);
  constexpr std::uint64_t kSeed = 20240614;
  std::mt19937_64 random(kSeed);
  for (int round = 0; round < 3000; ++round) {
    auto bytes = sound;
    // The header is where the numbers are that geodesy works with.
    const std::size_t reach = round % 2 == 0 ? 92 : bytes.size();
    for (int k = 0; k < 4; ++k) {
      bytes[random() % reach] = static_cast<std::uint8_t>(random());
    }
    ASSERT_NO_THROW(verify::check_tile(scheme, kLeaf, bytes, verify::OcclusionRule::kAlwaysRight))
        << "seed " << kSeed << ", round " << round;
    if (round % 100 != 0) continue;
    set.put_bytes(kLeaf, bytes);
    ASSERT_NO_THROW(json_of(set.verify())) << "seed " << kSeed << ", round " << round;
  }
}

TEST(Verify, WantsASourceForHausdorff) {
  const SetFixture set(sixteen_tiles());
  EXPECT_THROW(set.verify({.hausdorff = verify::HausdorffMode::kMeasured}), UsageError);
}

}  // namespace
}  // namespace qmpipe::testing::verify_test
