// Each kind of damage is found under its own name and no other: a verify that cannot fail would be
// worthless.
#include "pipeline/verify/verify.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <limits>

#include "formats/tile/oct_normal.h"
#include "tests/support/verify_fixture.h"

namespace qmpipe::testing::damage_test {
namespace {

using ::testing::ElementsAre;

using Damage = std::function<void(const SetFixture&)>;

// Damages the mesh of the one tile without neighbours.
Damage leaf(const std::function<void(QuantizedMesh&)>& damage) {
  return [damage](const SetFixture& set) { set.change(kLeaf, damage); };
}

void cut_edge_in_half(QuantizedMesh& mesh, std::size_t triangle, std::size_t corner) {
  std::uint32_t* corners = &mesh.indices[3 * triangle];
  const std::uint32_t a = corners[corner];
  const std::uint32_t b = corners[(corner + 1) % 3];
  const std::uint32_t c = corners[(corner + 2) % 3];
  const std::uint32_t middle =
      add_vertex(mesh, (mesh.u[a] + mesh.u[b]) / 2, (mesh.v[a] + mesh.v[b]) / 2, mesh.h[a]);
  corners = &mesh.indices[3 * triangle];
  corners[0] = a;
  corners[1] = middle;
  corners[2] = c;
  mesh.indices.insert(mesh.indices.end(), {middle, b, c});
}

// A vertex in the middle of an edge, of which only one of the two triangles knows.
void make_t_junction(QuantizedMesh& mesh) {
  for (std::size_t k = 0; k < mesh.indices.size(); ++k) {
    const std::uint32_t a = mesh.indices[k];
    const std::uint32_t b = mesh.indices[k % 3 == 2 ? k - 2 : k + 1];
    const bool is_across = mesh.u[a] != mesh.u[b] && mesh.v[a] != mesh.v[b];
    const bool has_middle = (mesh.u[a] + mesh.u[b]) % 2 == 0 && (mesh.v[a] + mesh.v[b]) % 2 == 0;
    if (is_across && has_middle) return cut_edge_in_half(mesh, k / 3, k % 3);
  }
  FAIL() << "no edge with a middle";
}

void cut_east_side(QuantizedMesh& mesh) {
  const std::uint32_t a = mesh.sides[index_of(Side::kEast)][3];
  const std::uint32_t b = mesh.sides[index_of(Side::kEast)][4];
  for (std::size_t k = 0; k < mesh.indices.size(); ++k) {
    const std::uint32_t next = mesh.indices[k % 3 == 2 ? k - 2 : k + 1];
    if (mesh.indices[k] != a || next != b) continue;
    cut_edge_in_half(mesh, k / 3, k % 3);
    auto& list = mesh.sides[index_of(Side::kEast)];
    list.insert(list.begin() + 4, static_cast<std::uint32_t>(mesh.vertex_count() - 1));
    return;
  }
  FAIL() << "no triangle at the edge";
}

void cover_twice(QuantizedMesh& mesh) {
  const auto corner_at = [&mesh](int u, int v) {
    std::uint32_t k = 0;
    while (mesh.u[k] != u || mesh.v[k] != v) ++k;
    return k;
  };
  const std::uint32_t south_west = corner_at(0, 0);
  const std::uint32_t north_east = corner_at(kQuantizedMax, kQuantizedMax);
  mesh.indices.insert(mesh.indices.end(), {south_west, corner_at(kQuantizedMax, 0), north_east});
  mesh.indices.insert(mesh.indices.end(), {south_west, north_east, corner_at(0, kQuantizedMax)});
}

void cut_off_corner(QuantizedMesh& mesh) {
  auto& west = mesh.sides[index_of(Side::kWest)];
  mesh.u[west.front()] = 100;
  west.erase(west.begin());
}

void split_vertex(QuantizedMesh& mesh) {
  const std::uint32_t k = vertex_inside(mesh);
  const std::uint32_t twin = add_vertex(mesh, mesh.u[k], mesh.v[k], mesh.h[k]);
  *std::find(mesh.indices.begin(), mesh.indices.end(), k) = twin;
}

void turn_normal_over(QuantizedMesh& mesh) {
  OctNormal& normal = mesh.normals[vertex_inside(mesh)];
  const Vec3 up = decode_oct_normal(normal);
  normal = encode_oct_normal({-up[0], -up[1], -up[2]});
}

void truncate_leaf(const SetFixture& set) {
  auto bytes = encode(set.read(kLeaf));
  bytes.resize(bytes.size() / 2);
  set.put_bytes(kLeaf, bytes);
}

void claim_65536_vertices(const SetFixture& set) {
  auto bytes = encode(set.read(kLeaf));
  bytes[88] = 0;
  bytes[89] = 0;
  bytes[90] = 1;
  set.put_bytes(kLeaf, bytes);
}

struct Case {
  const char* name;
  const char* fault;
  Damage damage;
};

std::vector<Case> tile_cases() {
  using Mesh = QuantizedMesh;
  return {
      {"Truncated", "unreadable-tile", truncate_leaf},
      {"NoGzip", "unreadable-tile",
       [](const SetFixture& set) {
         set.put_bytes(kLeaf, {0x1f, 0x8b, 8, 0, 1});
       }},
      {"VertexCount", "forbidden-vertex-count", claim_65536_vertices},
      {"FlippedTriangle", "clockwise-triangle",
       leaf([](Mesh& m) { std::swap(m.indices[3], m.indices[4]); })},
      {"FlatTriangle", "degenerate-triangle", leaf([](Mesh& m) {
         m.indices.insert(m.indices.end(), {0, 0, 1});
       })},
      {"TriangleTwice", "repeated-edge", leaf([](Mesh& m) {
         m.indices.insert(m.indices.end(), {m.indices[0], m.indices[1], m.indices[2]});
       })},
      {"Hole", "open-edge", leaf([](Mesh& m) {
         const auto at = static_cast<std::ptrdiff_t>(3 * triangle_off_the_sides(m));
         m.indices.erase(m.indices.begin() + at, m.indices.begin() + at + 3);
       })},
      {"TJunction", "open-edge", leaf(make_t_junction)},
      {"CoveredTwice", "area", leaf(cover_twice)},
      {"Corner", "missing-corner", leaf(cut_off_corner)},
      {"SideEntryMissing", "side-list",
       leaf([](Mesh& m) { m.sides[1].erase(m.sides[1].begin()); })},
      {"SideStranger", "side-list", leaf([](Mesh& m) { m.sides[1][2] = m.sides[3][2]; })},
      {"SideEntryTwice", "side-list",
       leaf([](Mesh& m) { m.sides[0].push_back(m.sides[0].back()); })},
      {"SideOrder", "side-list", leaf([](Mesh& m) { std::swap(m.sides[2][1], m.sides[2][2]); })},
      {"UnusedVertex", "unused-vertex", leaf([](Mesh& m) { add_vertex(m, 1001, 1003, 500); })},
      {"SplitVertex", "duplicate-vertex", leaf(split_vertex)},
      {"HeightsReversed", "height-range",
       leaf([](Mesh& m) { std::swap(m.header.min_height_m, m.header.max_height_m); })},
      {"HeightsNan", "height-range",
       leaf([](Mesh& m) { m.header.max_height_m = std::numeric_limits<float>::quiet_NaN(); })},
      {"SphereMoved", "bounding-sphere",
       leaf([](Mesh& m) { m.header.sphere_centre_ecef_m[0] += 1e5; })},
      {"SphereNegative", "bounding-sphere", leaf([](Mesh& m) { m.header.sphere_radius_m = -1; })},
      {"OcclusionLow", "occlusion-point", leaf([](Mesh& m) {
         for (double& c : m.header.horizon_occlusion_point) c *= 0.99999;
       })},
      {"OcclusionNan", "occlusion-point", leaf([](Mesh& m) {
         m.header.horizon_occlusion_point[1] = std::numeric_limits<double>::quiet_NaN();
       })},
      // The direction that the noise of a hemisphere's sphere gives: nothing is drawn opposite to it.
      {"RootHiddenFromOneSide", "hidden-terrain",
       [](const SetFixture& set) {
         set.change({0, 0, 0}, [](Mesh& m) {
           m.header.horizon_occlusion_point = {-6e5, -7e5, -3e5};
         });
       }},
      // Along the middle, but near enough to be hidden in the earth's shadow.
      {"RootHiddenInTheShadow", "hidden-terrain",
       [](const SetFixture& set) {
         set.change({0, 1, 0}, [](Mesh& m) { m.header.horizon_occlusion_point = {0, 1e6, 0}; });
       }},
      {"CentreElsewhere", "centre", leaf([](Mesh& m) {
         m.header.centre_ecef_m = {0, 0, 0};
       })},
      {"NormalDown", "normal-into-ground", leaf(turn_normal_over)},
  };
}

std::vector<Case> border_cases() {
  return {
      {"BorderVertex", "border-vertices",
       [](const SetFixture& set) { set.change(kWestTile, cut_east_side); }},
      {"Crack", "crack", [](const SetFixture& set) { sink_side(set, kLeafParent, Side::kWest); }},
      {"CrackNorth", "crack",
       [](const SetFixture& set) { sink_side(set, kWestTile, Side::kNorth); }},
      {"CrackAtAntimeridian", "crack",
       [](const SetFixture& set) { sink_side(set, kBeforeAntimeridian, Side::kEast); }},
      {"BorderNormal", "border-normals",
       [](const SetFixture& set) {
         set.change(kWestTile, [](QuantizedMesh& mesh) {
           mesh.normals[vertex_on_side(mesh, Side::kEast)][0] ^= 1U;
         });
       }},
  };
}

std::vector<Case> set_cases() {
  constexpr TileKey kRoot = {.zoom = 0, .x = 1, .y = 0};
  return {
      {"NoLayer", "layer-json",
       [](const SetFixture& set) { std::filesystem::remove(set.path() / "layer.json"); }},
      {"LayerIsNoJson", "layer-json", [](const SetFixture& set) { set.put("layer.json", "{"); }},
      {"Schema", "layer-json",
       [](const SetFixture& set) { set.replace_in_layer("\"scheme\"", "\"schema\""); }},
      {"SlippyMap", "layer-json",
       [](const SetFixture& set) { set.replace_in_layer("\"tms\"", "\"slippyMap\""); }},
      {"Format", "layer-json",
       [](const SetFixture& set) { set.replace_in_layer("quantized-mesh-1.0", "mesh"); }},
      {"MaxZoom", "layer-json",
       [](const SetFixture& set) { set.replace_in_layer("\"maxzoom\": 3", "\"maxzoom\": 2"); }},
      {"Address", "layer-json",
       [](const SetFixture& set) { set.replace_in_layer("{z}/{x}", "{z}/x"); }},
      {"Recipe", "layer-json",
       [](const SetFixture& set) {
         set.change_layer([](LayerJson& layer) { layer.qmpipe_json = "{\"scheme\":1}"; });
       }},
      {"FileGone", "missing-file", [](const SetFixture& set) { set.remove_file(kLeaf); }},
      {"Unlisted", "unlisted-tile", [](const SetFixture& set) { set.unlist(kLeaf); }},
      {"ParentGone", "missing-parent",
       [](const SetFixture& set) {
         set.remove_file(kLeafParent);
         set.unlist(kLeafParent);
       }},
      {"RootGone", "missing-root",
       [kRoot](const SetFixture& set) {
         set.remove_file(kRoot);
         set.unlist(kRoot);
       }},
      {"Stray", "stray-file", [](const SetFixture& set) { set.put("2/1/02.terrain", "x"); }},
      {"NormalsNotListed", "extension-not-listed",
       [](const SetFixture& set) {
         set.change_layer([](LayerJson& layer) { layer.extensions.clear(); });
       }},
      {"MaskNotListed", "extension-not-listed",
       leaf([](QuantizedMesh& mesh) { mesh.water_mask = {0}; })},
      {"MaskAbsent", "extension-absent",
       [](const SetFixture& set) {
         set.change_layer([](LayerJson& layer) { layer.extensions.push_back("watermask"); });
       }},
      {"NormalsAbsent", "extension-absent",
       leaf([](QuantizedMesh& mesh) { mesh.normals.clear(); })},
      {"Metadata", "metadata", leaf([](QuantizedMesh& mesh) { mesh.metadata_json = "{}"; })},
      {"MetadataMissing", "metadata",
       [](const SetFixture& set) {
         set.replace_in_layer("\"available\"", "\"metadataAvailability\": 2, \"available\"");
       }},
  };
}

class Damaged : public ::testing::TestWithParam<Case> {};

TEST_P(Damaged, IsFoundUnderItsNameAndNoOther) {
  const SetFixture set(sixteen_tiles());
  GetParam().damage(set);
  EXPECT_THAT(set.fault_kinds(), ElementsAre(GetParam().fault)) << text_of(set.verify());
}

const auto kNameOf = [](const auto& info) { return std::string(info.param.name); };
INSTANTIATE_TEST_SUITE_P(Tile, Damaged, ::testing::ValuesIn(tile_cases()), kNameOf);
INSTANTIATE_TEST_SUITE_P(Border, Damaged, ::testing::ValuesIn(border_cases()), kNameOf);
INSTANTIATE_TEST_SUITE_P(Set, Damaged, ::testing::ValuesIn(set_cases()), kNameOf);

}  // namespace
}  // namespace qmpipe::testing::damage_test
