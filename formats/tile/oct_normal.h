// Unit normals in two bytes: octahedral encoding as the clients decode it (CesiumJS,
// AttributeCompression.octEncode/octDecode; quantized-mesh extension 1).
//
// Guarantees: pure double arithmetic, so the same vector gives the same bytes everywhere; the
// decoded normal is within 1 degree of the encoded one.
#pragma once

#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

// REQUIRES: a finite vector, not zero; its length does not matter.
OctNormal encode_oct_normal(const Vec3& normal);

// A unit vector, for any two bytes.
Vec3 decode_oct_normal(const OctNormal& encoded);

}  // namespace qmpipe
