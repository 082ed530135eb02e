// One triangle mesh as a file that other programs open: PLY (binary), OBJ (text), GLB, STL (binary).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

// z points up.
struct ExportMesh {
  std::vector<Vec3> positions_m;
  std::vector<std::array<float, 3>> normals;  // unit, or empty
  std::vector<std::uint32_t> indices;
};

enum class MeshFormat { kPly, kObj, kGlb, kStl };

// By the extension, in any case: .ply, .obj, .glb, .stl. Throws UsageError for any other.
MeshFormat mesh_format_of(const std::filesystem::path& path);

// In the format that the name asks for. Throws UsageError as above and when a GLB would be larger
// than its 4 GiB, IoError when the file cannot be written. PLY and OBJ keep doubles' digits and z up.
// GLB stores float32 and, as glTF wants it, y up: (x, y, z) is written as (x, z, -y). STL stores
// float32, z up, a normal for each triangle and no shared vertices; the mesh's normals are left out.
// REQUIRES: at least one vertex and one triangle; finite positions; normals empty or one for each
// vertex; every index < vertex count.
void write_mesh_file(const std::filesystem::path& path, const ExportMesh& mesh);

}  // namespace qmpipe
