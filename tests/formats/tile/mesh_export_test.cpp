#include "formats/tile/mesh_export.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstring>
#include <nlohmann/json.hpp>
#include <sstream>

#include "formats/bytes/errors.h"
#include "scheduler/check.h"
#include "tests/support/temporary_folder.h"

namespace qmpipe::mesh_export_test {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

ExportMesh two_triangles() {
  return {.positions_m = {{0.1, 0, 1.0 / 3}, {10, 0, -5}, {0, 20, 7}, {10, 20, 0}},
          .normals = {{0, 0, 1}, {0, 1, 0}, {1, 0, 0}, {0, 0, 1}},
          .indices = {0, 1, 2, 2, 1, 3}};
}

template <class T>
T number_at(const std::string& bytes, std::size_t at) {
  T value;
  std::memcpy(&value, bytes.data() + at, sizeof value);
  return value;
}

TEST(MeshExport, PlyKeepsEveryDoubleAndEveryIndex) {
  const TemporaryFolder folder;
  const ExportMesh mesh = two_triangles();
  write_mesh_file(folder.path() / "m.PLY", mesh);
  const std::string bytes = folder.get("m.PLY");
  ASSERT_TRUE(bytes.starts_with("ply\nformat binary_little_endian 1.0\n"));
  EXPECT_THAT(bytes, HasSubstr("element vertex 4\nproperty double x\n"));
  std::size_t at = bytes.find("end_header\n") + 11;
  for (std::size_t i = 0; i < 4; ++i) {
    for (std::size_t k = 0; k < 3; ++k, at += 8) {
      EXPECT_EQ(number_at<double>(bytes, at), mesh.positions_m[i][k]);
    }
    for (std::size_t k = 0; k < 3; ++k, at += 4) {
      EXPECT_EQ(number_at<float>(bytes, at), mesh.normals[i][k]);
    }
  }
  for (std::size_t i = 0; i < 6; i += 3) {
    EXPECT_EQ(bytes[at++], 3);
    for (std::size_t k = 0; k < 3; ++k, at += 4) {
      EXPECT_EQ(number_at<std::uint32_t>(bytes, at), mesh.indices[i + k]);
    }
  }
  EXPECT_EQ(at, bytes.size());
}

TEST(MeshExport, ObjKeepsEveryDoubleAndCountsFromOne) {
  const TemporaryFolder folder;
  ExportMesh mesh = two_triangles();
  write_mesh_file(folder.path() / "m.obj", mesh);
  const std::string text = folder.get("m.obj");
  EXPECT_THAT(text, HasSubstr("f 1//1 2//2 3//3\nf 3//3 2//2 4//4\n"));
  EXPECT_THAT(text, HasSubstr("vn 0 1 0\n"));
  std::istringstream lines(text);
  std::string line;
  std::size_t vertex = 0;
  while (std::getline(lines, line)) {
    if (!line.starts_with("v ")) continue;
    std::istringstream numbers(line.substr(2));
    for (const double wanted : mesh.positions_m.at(vertex)) {
      std::string number;
      numbers >> number;
      EXPECT_EQ(std::stod(number), wanted);
    }
    ++vertex;
  }
  EXPECT_EQ(vertex, 4U);
  mesh.normals.clear();
  write_mesh_file(folder.path() / "m.obj", mesh);
  EXPECT_THAT(folder.get("m.obj"), HasSubstr("f 1 2 3\n"));
}

// Checks the container and returns the JSON; `binary_at` is where the binary chunk's data starts.
nlohmann::json check_glb_container(const std::string& bytes, std::size_t& binary_at) {
  EXPECT_EQ(bytes.substr(0, 4), "glTF");
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 4), 2U);
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 8), bytes.size());
  const auto json_bytes = number_at<std::uint32_t>(bytes, 12);
  EXPECT_EQ(json_bytes % 4, 0U);
  EXPECT_EQ(bytes.substr(16, 4), "JSON");
  binary_at = 20 + json_bytes + 8;
  const auto binary_bytes = number_at<std::uint32_t>(bytes, 20 + json_bytes);
  EXPECT_EQ(binary_bytes % 4, 0U);
  EXPECT_EQ(bytes.substr(binary_at - 4, 4), std::string("BIN\0", 4));
  EXPECT_EQ(binary_at + binary_bytes, bytes.size());
  const nlohmann::json document = nlohmann::json::parse(bytes.substr(20, json_bytes));
  EXPECT_EQ(document["buffers"][0]["byteLength"], binary_bytes);
  return document;
}

TEST(MeshExport, GlbIsAWholeGltfWithYUp) {
  const TemporaryFolder folder;
  const ExportMesh mesh = two_triangles();
  write_mesh_file(folder.path() / "m.glb", mesh);
  const std::string bytes = folder.get("m.glb");
  std::size_t binary_at = 0;
  const nlohmann::json document = check_glb_container(bytes, binary_at);
  EXPECT_EQ(document["asset"]["version"], "2.0");
  EXPECT_EQ(document["scenes"][0]["nodes"], nlohmann::json::array({0}));
  EXPECT_EQ(document["nodes"][0]["mesh"], 0);
  const nlohmann::json& primitive = document["meshes"][0]["primitives"][0];

  const auto data_of = [&](const nlohmann::json& accessor_index) {
    const nlohmann::json& accessor = document["accessors"][accessor_index.get<std::size_t>()];
    const nlohmann::json& view = document["bufferViews"][accessor["bufferView"].get<std::size_t>()];
    return std::pair(accessor, binary_at + view["byteOffset"].get<std::size_t>());
  };
  const auto [positions, positions_at] = data_of(primitive["attributes"]["POSITION"]);
  EXPECT_EQ(positions["count"], 4);
  EXPECT_EQ(positions["type"], "VEC3");
  std::array<float, 3> low{1e9F, 1e9F, 1e9F};
  std::array<float, 3> high{-1e9F, -1e9F, -1e9F};
  for (std::size_t i = 0; i < 4; ++i) {
    const Vec3& p = mesh.positions_m[i];
    const std::array<double, 3> wanted = {p[0], p[2], -p[1]};
    for (std::size_t k = 0; k < 3; ++k) {
      const float value = number_at<float>(bytes, positions_at + 12 * i + 4 * k);
      EXPECT_EQ(value, static_cast<float>(wanted[k]));
      low[k] = std::min(low[k], value);
      high[k] = std::max(high[k], value);
    }
  }
  EXPECT_EQ((positions["min"].get<std::array<float, 3>>()), low);
  EXPECT_EQ((positions["max"].get<std::array<float, 3>>()), high);

  const auto [indices, indices_at] = data_of(primitive["indices"]);
  EXPECT_EQ(indices["componentType"], 5125);
  ASSERT_EQ(indices["count"], 6);
  for (std::size_t i = 0; i < 6; ++i) {
    EXPECT_EQ(number_at<std::uint32_t>(bytes, indices_at + 4 * i), mesh.indices[i]);
  }
  EXPECT_EQ(data_of(primitive["attributes"]["NORMAL"]).first["count"], 4);
}

TEST(MeshExport, StlHasEveryTriangleWithItsNormal) {
  const TemporaryFolder folder;
  ExportMesh mesh = two_triangles();
  mesh.positions_m.push_back(mesh.positions_m[3]);
  mesh.normals.push_back({0, 0, 1});
  mesh.indices.insert(mesh.indices.end(), {0, 3, 4});  // without area
  write_mesh_file(folder.path() / "m.Stl", mesh);
  const std::string bytes = folder.get("m.Stl");
  ASSERT_EQ(bytes.size(), 84U + 3 * 50);
  EXPECT_FALSE(bytes.starts_with("solid"));
  EXPECT_EQ(number_at<std::uint32_t>(bytes, 80), 3U);
  std::size_t at = 84;
  for (std::size_t t = 0; t < 3; ++t) {
    std::array<std::array<double, 3>, 4> vectors{};  // the normal and the corners
    for (auto& vector : vectors) {
      for (double& value : vector) {
        value = number_at<float>(bytes, at);
        at += 4;
      }
    }
    EXPECT_EQ(number_at<std::uint16_t>(bytes, at), 0);
    at += 2;
    const auto& n = vectors[0];
    const double wanted_length = t < 2 ? 1 : 0;
    EXPECT_NEAR(n[0] * n[0] + n[1] * n[1] + n[2] * n[2], wanted_length, 1e-6);
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& corner = mesh.positions_m[mesh.indices[3 * t + k]];
      double along = 0;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        EXPECT_EQ(vectors[k + 1][axis], static_cast<float>(corner[axis]));
        along += n[axis] * (vectors[k + 1][axis] - vectors[1][axis]);
      }
      EXPECT_NEAR(along, 0, 1e-5);
    }
    // Both triangles are counter-clockwise from above.
    if (t < 2) {
      EXPECT_GT(n[2], 0);
    }
  }
  EXPECT_EQ(at, bytes.size());
}

TEST(MeshExport, FaultsAreToldByKind) {
  const TemporaryFolder folder;
  EXPECT_THROW(write_mesh_file(folder.path() / "m.off", two_triangles()), UsageError);
  EXPECT_THROW(write_mesh_file(folder.path() / "m", two_triangles()), UsageError);
  folder.put("file", "x");
  EXPECT_THROW(write_mesh_file(folder.path() / "file/m.ply", two_triangles()), IoError);
  EXPECT_THROW(write_mesh_file(folder.path() / "none/m.glb", two_triangles()), IoError);
  EXPECT_THROW(write_mesh_file(folder.path() / "m.ply", {}), InternalError);
}

}  // namespace
}  // namespace qmpipe::mesh_export_test
