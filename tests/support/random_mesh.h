// Random tiles for the tests of formats/: right in form (what encode() requires), without any
// meaning as terrain.
#pragma once

#include <cstdint>
#include <random>
#include <vector>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe::testing {

enum class Extensions { kNone, kRandom };

// `vertex_count` vertices, all of them used; numbered by first use.
QuantizedMesh random_mesh(std::mt19937_64& random, std::size_t vertex_count, Extensions extensions);

// All fields, bit for bit (so that NaN equals NaN).
bool equal_bits(const QuantizedMesh& a, const QuantizedMesh& b);

// A flat square of n x n vertices with real triangles and complete side lists.
QuantizedMesh grid_mesh(std::uint32_t n);

}  // namespace qmpipe::testing
