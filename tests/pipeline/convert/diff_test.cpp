#include "pipeline/convert/diff_sets.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>

#include "formats/bytes/gzip.h"
#include "formats/tile_sets/open_tile_set.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::diff_test {
namespace {

using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using testing::kBeforeAntimeridian;
using testing::kLeaf;
using testing::kLeafParent;
using testing::kWestTile;
using testing::SetFixture;
using testing::TemporaryFolder;
namespace fs = std::filesystem;

const SetFixture& sound_set() {
  static const SetFixture set(testing::sixteen_tiles());
  return set;
}

// A set to change.
class CopiedSet : public SetFixture {
 public:
  CopiedSet() { fs::copy(sound_set().path(), path(), fs::copy_options::recursive); }
};

DiffReport diff_of(const fs::path& a, const fs::path& b, const DiffOptions& options = {}) {
  Progress progress(ProgressStyle::kSilent, nullptr);
  return diff_sets(*open_tile_set(a), *open_tile_set(b), options, progress);
}

DiffReport diff_with(const CopiedSet& changed, const DiffOptions& options = {}) {
  return diff_of(sound_set().path(), changed.path(), options);
}

// What differs in the only tile that does.
TileDifference difference_in(const CopiedSet& changed) {
  const DiffReport report = diff_with(changed);
  EXPECT_EQ(report.total.different, 1);
  EXPECT_EQ(report.total.same_bytes, 15);
  EXPECT_FALSE(report.is_same());
  return report.worst.at(0);
}

TEST(Diff, ASetIsTheSameAsItsCopy) {
  const CopiedSet copy;
  const DiffReport report = diff_with(copy);
  EXPECT_TRUE(report.is_same());
  EXPECT_EQ(report.total.tiles_a, 16);
  EXPECT_EQ(report.total.same_bytes, 16);
  EXPECT_THAT(report.worst, IsEmpty());
  ASSERT_EQ(report.zooms.size(), 4U);
  EXPECT_EQ(report.zooms[1].same_bytes, 8);
  EXPECT_THAT(text_of(report), HasSubstr("diff: the same, 16 tiles"));
}

TEST(Diff, OtherCompressionIsNoDifference) {
  const CopiedSet copy;
  const auto set = open_tile_set(copy.path());
  copy.put_bytes(kLeaf, *plain_tile_bytes(*set->read(kLeaf)));
  copy.put_bytes(kLeafParent, gzip_compress(*plain_tile_bytes(*set->read(kLeafParent)), 12));
  const DiffReport report = diff_with(copy);
  EXPECT_TRUE(report.is_same());
  EXPECT_EQ(report.total.same_unpacked, 2);
}

TEST(Diff, ARaisedVertexIsToldInMetres) {
  const CopiedSet copy;
  double step_m = 0;
  copy.change(kLeaf, [&](QuantizedMesh& mesh) {
    const std::uint32_t vertex = testing::vertex_inside(mesh);
    const int steps = mesh.h[vertex] < 20000 ? 1000 : -1000;
    mesh.h[vertex] = static_cast<std::uint16_t>(mesh.h[vertex] + steps);
    step_m = 1000.0 * (double{mesh.header.max_height_m} - double{mesh.header.min_height_m}) / 32767;
  });
  const TileDifference difference = difference_in(copy);
  EXPECT_EQ(difference.key, kLeaf);
  EXPECT_NEAR(difference.mesh.largest_height_m, step_m, 1e-9);
  EXPECT_EQ(difference.mesh.posts_only_in_a + difference.mesh.posts_only_in_b, 0);
  EXPECT_THAT(difference.parts, ElementsAre(HasSubstr("heights by up to")));
}

TEST(Diff, AMovedVertexIsAPostOfOneOnly) {
  const CopiedSet copy;
  copy.change(kLeaf, [](QuantizedMesh& mesh) {
    const std::uint32_t vertex = testing::vertex_inside(mesh);
    mesh.u[vertex] = static_cast<std::uint16_t>(mesh.u[vertex] + 1);
  });
  const TileDifference difference = difference_in(copy);
  EXPECT_EQ(difference.mesh.posts_only_in_a, 1);
  EXPECT_EQ(difference.mesh.posts_only_in_b, 1);
  EXPECT_EQ(difference.mesh.largest_height_m, 0);
  EXPECT_THAT(difference.parts, ElementsAre(HasSubstr("(1 posts only in A, 1 only in B)")));
}

TEST(Diff, TrianglesSideListsNormalsAndExtensionsAreToldApart) {
  const auto parts_after = [](const std::function<void(QuantizedMesh&)>& damage) {
    const CopiedSet copy;
    copy.change(kLeaf, damage);
    return difference_in(copy).parts;
  };
  EXPECT_THAT(
      parts_after([](QuantizedMesh& mesh) { mesh.indices.resize(mesh.indices.size() - 3); }),
      ElementsAre("the triangles (1 only in A, 0 only in B)"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) {
                std::rotate(mesh.indices.begin(), mesh.indices.begin() + 3, mesh.indices.end());
              }),
              ElementsAre("the order of the vertices"));
  EXPECT_THAT(
      parts_after([](QuantizedMesh& mesh) { mesh.sides[index_of(Side::kEast)].pop_back(); }),
      ElementsAre("the east side list"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.normals.clear(); }),
              ElementsAre("normals only in A"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) {
                mesh.normals[3] = {0, 0};
              }),
              ElementsAre(HasSubstr("normals by up to ")));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.water_mask = {255}; }),
              ElementsAre("the water mask"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.metadata_json = "{}"; }),
              ElementsAre("the metadata extension"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.header.sphere_radius_m += 2; }),
              ElementsAre(HasSubstr("the header's sphere radius")));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.header.centre_ecef_m[0] += 2; }),
              ElementsAre("the header's centre by 2 m"));
  EXPECT_THAT(parts_after([](QuantizedMesh& mesh) { mesh.header.horizon_occlusion_point[1] = 0; }),
              ElementsAre("the header's horizon occlusion point"));
}

TEST(Diff, BytesThatNobodyDecodesAreADifferenceToo) {
  const CopiedSet copy;
  auto bytes = *plain_tile_bytes(*open_tile_set(copy.path())->read(kLeaf));
  // An extension of an unknown kind, of one byte.
  for (const int byte : {200, 1, 0, 0, 0, 7}) bytes.push_back(static_cast<std::uint8_t>(byte));
  copy.put_bytes(kLeaf, bytes);
  EXPECT_THAT(difference_in(copy).parts, ElementsAre(HasSubstr("extensions that are not known")));
}

TEST(Diff, NoNumbersAsHeightsAreTheSameWhenTheirBitsAre) {
  const CopiedSet a;
  const CopiedSet b;
  const auto spoil = [](QuantizedMesh& mesh) { mesh.header.min_height_m = std::nanf(""); };
  a.change(kLeaf, spoil);
  b.change(kLeaf, [&](QuantizedMesh& mesh) {
    spoil(mesh);
    mesh.water_mask = {0};
  });
  const DiffReport report = diff_of(a.path(), b.path());
  EXPECT_THAT(report.worst.at(0).parts, ElementsAre("the water mask"));
  EXPECT_THAT(diff_with(a).worst.at(0).parts, Contains(HasSubstr("heights by up to inf m")));
  EXPECT_THAT(json_of(diff_with(a)), HasSubstr("\"largest_height_m\": null"));
}

TEST(Diff, TilesOfOneSetOnlyAreListed) {
  const CopiedSet copy;
  copy.remove_file(kLeaf);
  copy.remove_file(kWestTile);
  const DiffReport report = diff_with(copy);
  EXPECT_THAT(report.only_in_a, ElementsAre(kWestTile, kLeaf));
  EXPECT_THAT(report.only_in_b, IsEmpty());
  EXPECT_EQ(report.total.tiles_a, 16);
  EXPECT_EQ(report.total.tiles_b, 14);
  const DiffReport other = diff_of(copy.path(), sound_set().path(), {.most_listed = 1});
  EXPECT_THAT(other.only_in_b, ElementsAre(kWestTile));
  EXPECT_EQ(other.total.only_in_b, 2);
  EXPECT_THAT(text_of(other), HasSubstr("1 more only in B not shown"));
}

TEST(Diff, LayersAreComparedByTheirKeys) {
  const CopiedSet copy;
  const std::string layer = *open_tile_set(copy.path())->layer_text();
  copy.put("layer.json", "  " + layer);
  EXPECT_TRUE(diff_with(copy).is_same());
  copy.change_layer([](LayerJson& changed) {
    changed.attribution = "somebody";
    changed.available.at(3).clear();
  });
  const DiffReport report = diff_with(copy);
  EXPECT_FALSE(report.is_same());
  ASSERT_EQ(report.layer.size(), 2U);
  EXPECT_EQ(report.layer[0].key, "attribution");
  EXPECT_EQ(report.layer[0].b, "\"somebody\"");
  EXPECT_EQ(report.layer[1].key, "available[3]");
  EXPECT_EQ(report.layer[1].b, "[]");
  copy.put("layer.json", "{");
  EXPECT_EQ(diff_with(copy).layer.at(0).key, "layer.json");
  EXPECT_EQ(diff_of(copy.path(), copy.path()).layer.size(), 0U);
}

TEST(Diff, TheWorstComeFirstAndThreadsDoNotMatter) {
  const CopiedSet copy;
  const auto raise = [&](const TileKey& key, double by_m) {
    copy.change(key, [by_m](QuantizedMesh& mesh) {
      mesh.header.min_height_m += static_cast<float>(by_m);
      mesh.header.max_height_m += static_cast<float>(by_m);
    });
  };
  raise(kWestTile, 1);
  raise(kLeafParent, 100);
  raise(kLeaf, 1);
  copy.put_bytes(kBeforeAntimeridian, {1, 2, 3});
  const DiffReport report = diff_with(copy);
  ASSERT_EQ(report.worst.size(), 4U);
  EXPECT_EQ(report.worst[0].key, kBeforeAntimeridian);
  EXPECT_THAT(report.worst[0].parts, ElementsAre(HasSubstr("B cannot be decoded: ")));
  EXPECT_EQ(report.worst[1].key, kLeafParent);
  EXPECT_NEAR(report.worst[1].mesh.largest_height_m, 100, 1e-3);
  EXPECT_EQ(report.total.undecodable, 1);
  EXPECT_NEAR(report.total.largest_height_m, 100, 1e-3);
  const std::string text = text_of(report) + json_of(report);
  for (const std::int32_t threads : {2, 5}) {
    const DiffReport again = diff_with(copy, {.threads = threads});
    EXPECT_EQ(text_of(again) + json_of(again), text);
  }
  const DiffReport two = diff_with(copy, {.most_listed = 2});
  ASSERT_EQ(two.worst.size(), 2U);
  EXPECT_EQ(two.worst[1].key, kLeafParent);
  EXPECT_THAT(text_of(two), HasSubstr("2 more different not shown"));
}

TEST(Diff, AnInterruptionEndsIt) {
  const std::atomic<bool> stop = true;
  Progress progress(ProgressStyle::kSilent, &stop);
  const auto set = open_tile_set(sound_set().path());
  EXPECT_THROW(diff_sets(*set, *set, {}, progress), Interrupted);
}

}  // namespace
}  // namespace qmpipe::diff_test
