// One tile in the form of quantized-mesh-1.0, and its bytes (CesiumGS/quantized-mesh, SPECIFICATION).
//
// u runs from west (0) to east (32767), v from south to north, h from the header's minimum to its
// maximum height; all three are linear in longitude, latitude and height. Index lists of sides:
// west, south, east, north; west and east ascend in v, south and north in u.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

inline constexpr std::int32_t kQuantizedMax = 32767;
// CesiumJS reads a tile of exactly this many vertices in neither index width.
inline constexpr std::size_t kForbiddenVertexCount = 65536;

// Of an encoded tile, whatever else is in it.
bool has_forbidden_vertex_count(std::span<const std::uint8_t> bytes);

using Vec3 = std::array<double, 3>;
// Unit normal in ECEF, octahedral encoding, x then y.
using OctNormal = std::array<std::uint8_t, 2>;

struct QuantizedMeshHeader {
  Vec3 centre_ecef_m{};
  float min_height_m = 0;
  float max_height_m = 0;
  Vec3 sphere_centre_ecef_m{};
  double sphere_radius_m = 0;
  // In units of the ellipsoid's radii.
  Vec3 horizon_occlusion_point{};
};

struct QuantizedMesh {
  QuantizedMeshHeader header;
  std::vector<std::uint16_t> u;
  std::vector<std::uint16_t> v;
  std::vector<std::uint16_t> h;
  // Three for each triangle, counter-clockwise seen from above.
  std::vector<std::uint32_t> indices;
  // By index_of(Side).
  std::array<std::vector<std::uint32_t>, 4> sides;
  // Extension 1; empty when the tile has none.
  std::vector<OctNormal> normals;
  // Extension 2 (1 or 65,536 bytes) and 4 (JSON); absent when the tile has none.
  std::vector<std::uint8_t> water_mask;
  std::optional<std::string> metadata_json;

  std::size_t vertex_count() const { return u.size(); }
  std::size_t triangle_count() const { return indices.size() / 3; }
};

// The tile's bytes, uncompressed: 16-bit indices up to 65,535 vertices, 32-bit from 65,537.
// REQUIRES: vertices numbered in order of first use by the triangles; 1..N vertices, not exactly
// 65,536; u, v, h of one length and <= 32767; every index < vertex count; normals empty or one for
// each vertex; a water mask of 0, 1 or 65,536 bytes; no side longer than the vertices.
std::vector<std::uint8_t> encode(const QuantizedMesh& mesh);

// Reads a tile that may be damaged or hostile. Never throws, never reads past the end, allocates
// only what the bytes can hold. Strict: refuses truncated data, out-of-range indices and codes,
// values above 32767, trailing bytes that form no extension, lists longer than the vertices allow,
// known extensions of a wrong length or given twice, no vertices or exactly 65,536.
// Unknown extensions are skipped by their length. Header fields and metadata are taken as they are
// (NaN included). What it returns, encode() accepts.
Result<QuantizedMesh> decode(std::span<const std::uint8_t> bytes);

}  // namespace qmpipe
