#include "formats/tile/mesh_export.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/letter_case.h"
#include "formats/bytes/little_endian.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Bytes = std::vector<std::uint8_t>;

Bytes ply_bytes(const ExportMesh& mesh) {
  std::string header = fmt::format(
      "ply\nformat binary_little_endian 1.0\ncomment written by qmpipe, metres, z up\n"
      "element vertex {}\nproperty double x\nproperty double y\nproperty double z\n",
      mesh.positions_m.size());
  if (!mesh.normals.empty()) {
    header += "property float nx\nproperty float ny\nproperty float nz\n";
  }
  header += fmt::format("element face {}\nproperty list uchar uint vertex_indices\nend_header\n",
                        mesh.indices.size() / 3);
  Bytes bytes(header.begin(), header.end());
  for (std::size_t i = 0; i < mesh.positions_m.size(); ++i) {
    for (const double value : mesh.positions_m[i]) append_little_endian(bytes, value);
    if (mesh.normals.empty()) continue;
    for (const float value : mesh.normals[i]) append_little_endian(bytes, value);
  }
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    append_little_endian(bytes, std::uint8_t{3});
    for (std::size_t k = 0; k < 3; ++k) append_little_endian(bytes, mesh.indices[i + k]);
  }
  return bytes;
}

Bytes obj_bytes(const ExportMesh& mesh) {
  Bytes bytes;
  auto out = std::back_inserter(bytes);
  fmt::format_to(out, "# written by qmpipe, metres, z up\n");
  for (const Vec3& p : mesh.positions_m) fmt::format_to(out, "v {} {} {}\n", p[0], p[1], p[2]);
  for (const auto& n : mesh.normals) fmt::format_to(out, "vn {} {} {}\n", n[0], n[1], n[2]);
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    fmt::format_to(out, "f");
    for (std::size_t k = 0; k < 3; ++k) {
      const std::uint64_t number = std::uint64_t{mesh.indices[i + k]} + 1;
      if (mesh.normals.empty()) {
        fmt::format_to(out, " {}", number);
      } else {
        fmt::format_to(out, " {}//{}", number, number);
      }
    }
    fmt::format_to(out, "\n");
  }
  return bytes;
}

using Float3 = std::array<float, 3>;

template <class T>
Float3 y_up(const std::array<T, 3>& p) {
  return {static_cast<float>(p[0]), static_cast<float>(p[2]), static_cast<float>(-p[1])};
}

// glTF's numbers for component types and buffer targets.
constexpr int kFloat32 = 5126;
constexpr int kUint32 = 5125;
constexpr int kVertexData = 34962;
constexpr int kIndexData = 34963;
// Lengths are 32 bits; a little less for the two chunks' headers.
constexpr std::size_t kMostGlbBytes = 0xFFFFFF00;

// The JSON and the binary chunk as they grow.
struct GlbParts {
  nlohmann::ordered_json accessors = nlohmann::ordered_json::array();
  nlohmann::ordered_json views = nlohmann::ordered_json::array();
  Bytes binary;

  // Everything that was appended since `begin` becomes one view with one accessor.
  std::size_t add_accessor(std::size_t begin, int target, nlohmann::ordered_json accessor) {
    views.push_back({{"buffer", 0},
                     {"byteOffset", begin},
                     {"byteLength", binary.size() - begin},
                     {"target", target}});
    accessor["bufferView"] = views.size() - 1;
    accessors.push_back(std::move(accessor));
    return accessors.size() - 1;
  }
};

std::size_t add_positions(GlbParts& parts, const ExportMesh& mesh) {
  const std::size_t begin = parts.binary.size();
  Float3 low = y_up(mesh.positions_m.front());
  Float3 high = low;
  for (const Vec3& position : mesh.positions_m) {
    const Float3 p = y_up(position);
    for (std::size_t k = 0; k < 3; ++k) {
      append_little_endian(parts.binary, p[k]);
      low[k] = std::min(low[k], p[k]);
      high[k] = std::max(high[k], p[k]);
    }
  }
  return parts.add_accessor(begin, kVertexData,
                            {{"componentType", kFloat32},
                             {"count", mesh.positions_m.size()},
                             {"type", "VEC3"},
                             {"min", {low[0], low[1], low[2]}},
                             {"max", {high[0], high[1], high[2]}}});
}

std::size_t add_normals(GlbParts& parts, const ExportMesh& mesh) {
  const std::size_t begin = parts.binary.size();
  for (const Float3& normal : mesh.normals) {
    for (const float value : y_up(normal)) append_little_endian(parts.binary, value);
  }
  return parts.add_accessor(
      begin, kVertexData,
      {{"componentType", kFloat32}, {"count", mesh.normals.size()}, {"type", "VEC3"}});
}

std::size_t add_indices(GlbParts& parts, const ExportMesh& mesh) {
  const std::size_t begin = parts.binary.size();
  for (const std::uint32_t index : mesh.indices) append_little_endian(parts.binary, index);
  return parts.add_accessor(
      begin, kIndexData,
      {{"componentType", kUint32}, {"count", mesh.indices.size()}, {"type", "SCALAR"}});
}

Bytes glb_bytes(const ExportMesh& mesh) {
  GlbParts parts;
  nlohmann::ordered_json attributes;
  attributes["POSITION"] = add_positions(parts, mesh);
  if (!mesh.normals.empty()) attributes["NORMAL"] = add_normals(parts, mesh);
  const std::size_t indices = add_indices(parts, mesh);

  nlohmann::ordered_json document;
  document["asset"] = {{"version", "2.0"}, {"generator", "qmpipe"}};
  document["scene"] = 0;
  document["scenes"] = nlohmann::ordered_json::array({{{"nodes", {0}}}});
  document["nodes"] = nlohmann::ordered_json::array({{{"mesh", 0}}});
  nlohmann::ordered_json primitive = {{"attributes", attributes}, {"indices", indices}};
  nlohmann::ordered_json gltf_mesh;
  gltf_mesh["primitives"] = nlohmann::ordered_json::array({primitive});
  document["meshes"] = nlohmann::ordered_json::array({gltf_mesh});
  document["buffers"] = nlohmann::ordered_json::array({{{"byteLength", parts.binary.size()}}});
  document["bufferViews"] = std::move(parts.views);
  document["accessors"] = std::move(parts.accessors);
  std::string json = document.dump();
  json.resize((json.size() + 3) / 4 * 4, ' ');
  if (parts.binary.size() + json.size() > kMostGlbBytes) {
    throw UsageError("the mesh is larger than the 4 GiB of a GLB; write a .ply, or a coarser mesh");
  }

  constexpr std::uint32_t kGltf = 0x46546C67;
  constexpr std::uint32_t kJsonChunk = 0x4E4F534A;
  constexpr std::uint32_t kBinaryChunk = 0x004E4942;
  Bytes bytes;
  append_little_endian(bytes, kGltf);
  append_little_endian(bytes, std::uint32_t{2});
  append_little_endian(bytes,
                       static_cast<std::uint32_t>(12 + 8 + json.size() + 8 + parts.binary.size()));
  append_little_endian(bytes, static_cast<std::uint32_t>(json.size()));
  append_little_endian(bytes, kJsonChunk);
  bytes.insert(bytes.end(), json.begin(), json.end());
  append_little_endian(bytes, static_cast<std::uint32_t>(parts.binary.size()));
  append_little_endian(bytes, kBinaryChunk);
  // Only whole floats and indices: a multiple of 4 bytes already.
  bytes.insert(bytes.end(), parts.binary.begin(), parts.binary.end());
  return bytes;
}

// The unit normal of a triangle as it is stored; zero for one that float32 has flattened.
Float3 normal_of(const std::array<Float3, 3>& corners) {
  Vec3 p{};
  Vec3 q{};
  for (std::size_t k = 0; k < 3; ++k) {
    p[k] = static_cast<double>(corners[1][k]) - static_cast<double>(corners[0][k]);
    q[k] = static_cast<double>(corners[2][k]) - static_cast<double>(corners[0][k]);
  }
  const Vec3 n = {p[1] * q[2] - p[2] * q[1], p[2] * q[0] - p[0] * q[2], p[0] * q[1] - p[1] * q[0]};
  const double length = std::sqrt(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]);
  if (length == 0) return {};
  return {static_cast<float>(n[0] / length), static_cast<float>(n[1] / length),
          static_cast<float>(n[2] / length)};
}

Bytes stl_bytes(const ExportMesh& mesh) {
  // Not "solid", with which a text file begins.
  std::string header = "binary STL written by qmpipe, metres, z up";
  header.resize(80, ' ');
  Bytes bytes(header.begin(), header.end());
  bytes.reserve(84 + 50 * (mesh.indices.size() / 3));
  append_little_endian(bytes, static_cast<std::uint32_t>(mesh.indices.size() / 3));
  for (std::size_t i = 0; i < mesh.indices.size(); i += 3) {
    std::array<Float3, 3> corners{};
    for (std::size_t k = 0; k < 3; ++k) {
      const Vec3& p = mesh.positions_m[mesh.indices[i + k]];
      corners[k] = {static_cast<float>(p[0]), static_cast<float>(p[1]), static_cast<float>(p[2])};
    }
    for (const float value : normal_of(corners)) append_little_endian(bytes, value);
    for (const Float3& corner : corners) {
      for (const float value : corner) append_little_endian(bytes, value);
    }
    append_little_endian(bytes, std::uint16_t{0});
  }
  return bytes;
}

Bytes bytes_of(const ExportMesh& mesh, MeshFormat format) {
  switch (format) {
    case MeshFormat::kPly:
      return ply_bytes(mesh);
    case MeshFormat::kObj:
      return obj_bytes(mesh);
    case MeshFormat::kGlb:
      return glb_bytes(mesh);
    case MeshFormat::kStl:
      break;
  }
  return stl_bytes(mesh);
}

void check_mesh(const ExportMesh& mesh) {
  QMPIPE_CHECK(!mesh.positions_m.empty());
  QMPIPE_CHECK(!mesh.indices.empty() && mesh.indices.size() % 3 == 0);
  QMPIPE_CHECK(mesh.normals.empty() || mesh.normals.size() == mesh.positions_m.size());
  QMPIPE_CHECK(*std::max_element(mesh.indices.begin(), mesh.indices.end()) <
               mesh.positions_m.size());
}

}  // namespace

MeshFormat mesh_format_of(const std::filesystem::path& path) {
  const std::string extension = lower_case(path.extension().string());
  if (extension == ".ply") return MeshFormat::kPly;
  if (extension == ".obj") return MeshFormat::kObj;
  if (extension == ".glb") return MeshFormat::kGlb;
  if (extension == ".stl") return MeshFormat::kStl;
  throw UsageError(fmt::format(
      "cannot tell the mesh format of {} from its extension; end it in .ply, .obj, .glb or .stl",
      path.string()));
}

void write_mesh_file(const std::filesystem::path& path, const ExportMesh& mesh) {
  const MeshFormat format = mesh_format_of(path);
  check_mesh(mesh);
  write_file_atomically(path, bytes_of(mesh, format));
}

}  // namespace qmpipe
