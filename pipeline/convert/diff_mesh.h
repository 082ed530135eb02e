// What differs between two tiles of one key, decoded.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

struct MeshDifference {
  // Each a few words: "heights by up to 1.5 m", "indices of 4 triangles"; empty when the two are
  // equal in all that is decoded.
  std::vector<std::string> parts;
  // Vertices stand for the same post where u and v are the same.
  std::int64_t posts_only_in_a = 0;
  std::int64_t posts_only_in_b = 0;
  // Over the posts of both; infinite where a header's heights are no numbers.
  double largest_height_m = 0;
  // Over the posts of both, where both have normals.
  double largest_normal_deg = 0;
};

MeshDifference difference_of(const QuantizedMesh& a, const QuantizedMesh& b);

}  // namespace qmpipe
