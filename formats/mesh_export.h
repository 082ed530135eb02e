// One triangle mesh as a file that other programs open: PLY (binary), OBJ (text), GLB.
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <vector>

#include "formats/quantized_mesh.h"

namespace qmpipe {

// z points up.
struct ExportMesh {
  std::vector<Vec3> positions_m;
  std::vector<std::array<float, 3>> normals;  // unit, or empty
  std::vector<std::uint32_t> indices;
};

// By the file's extension, in any case: .ply, .obj, .glb. Throws UsageError for any other, IoError
// when the file cannot be written. PLY and OBJ keep doubles' digits and z up; GLB stores float32
// and, as glTF wants it, y up: (x, y, z) is written as (x, z, -y).
// REQUIRES: at least one vertex and one triangle; finite positions; normals empty or one for each
// vertex; every index < vertex count.
void write_mesh_file(const std::filesystem::path& path, const ExportMesh& mesh);

}  // namespace qmpipe
