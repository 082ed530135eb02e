#include "tests/support/random_mesh.h"

#include <bit>
#include <cstring>

namespace qmpipe::testing {
namespace {

std::uint32_t below(std::mt19937_64& random, std::uint64_t end) {
  return static_cast<std::uint32_t>(random() % end);
}

std::vector<std::uint16_t> random_values(std::mt19937_64& random, std::size_t count) {
  std::vector<std::uint16_t> values(count);
  for (std::uint16_t& value : values) {
    // The ends of the range often: their differences are the largest.
    const std::uint32_t kind = below(random, 4);
    value = static_cast<std::uint16_t>(kind == 0   ? 0
                                       : kind == 1 ? kQuantizedMax
                                                   : below(random, kQuantizedMax + 1));
  }
  return values;
}

// New vertices come often enough that the last triangles use the last ones.
std::vector<std::uint32_t> random_triangles(std::mt19937_64& random, std::size_t vertex_count) {
  std::vector<std::uint32_t> indices;
  std::uint32_t highest = 0;
  while (highest < vertex_count || indices.size() % 3 != 0) {
    const bool is_new = highest == 0 || (highest < vertex_count && below(random, 2) == 0);
    indices.push_back(is_new ? highest : below(random, highest));
    highest += is_new ? 1U : 0U;
  }
  return indices;
}

void add_random_extensions(std::mt19937_64& random, QuantizedMesh& mesh) {
  if (below(random, 2) == 0) {
    mesh.normals.resize(mesh.vertex_count());
    for (OctNormal& normal : mesh.normals) {
      normal = {static_cast<std::uint8_t>(below(random, 256)),
                static_cast<std::uint8_t>(below(random, 256))};
    }
  }
  if (below(random, 2) == 0) mesh.water_mask.assign(below(random, 2) == 0 ? 1 : 65536, 255);
  if (below(random, 2) == 0) mesh.metadata_json = std::string(below(random, 30), '{');
}

}  // namespace

QuantizedMesh random_mesh(std::mt19937_64& random, std::size_t vertex_count,
                          Extensions extensions) {
  QuantizedMesh mesh;
  const auto number = [&random] { return static_cast<double>(random() >> 20U) / 1024.0; };
  mesh.header.centre_ecef_m = {number(), -number(), number()};
  mesh.header.min_height_m = static_cast<float>(-number());
  mesh.header.max_height_m = static_cast<float>(number());
  mesh.header.sphere_centre_ecef_m = {-number(), number(), number()};
  mesh.header.sphere_radius_m = number();
  mesh.header.horizon_occlusion_point = {number(), number(), -number()};
  mesh.u = random_values(random, vertex_count);
  mesh.v = random_values(random, vertex_count);
  mesh.h = random_values(random, vertex_count);
  mesh.indices = random_triangles(random, vertex_count);
  for (std::vector<std::uint32_t>& side : mesh.sides) {
    side.resize(below(random, std::min<std::size_t>(vertex_count, 300) + 1));
    for (std::uint32_t& index : side) index = below(random, vertex_count);
  }
  if (extensions == Extensions::kRandom) add_random_extensions(random, mesh);
  return mesh;
}

bool equal_bits(const QuantizedMesh& a, const QuantizedMesh& b) {
  const QuantizedMeshHeader& x = a.header;
  const QuantizedMeshHeader& y = b.header;
  // The header has no padding: ten doubles and two floats.
  static_assert(sizeof(QuantizedMeshHeader) == 10 * sizeof(double) + 2 * sizeof(float));
  return std::memcmp(&x, &y, sizeof x) == 0 && a.u == b.u && a.v == b.v && a.h == b.h &&
         a.indices == b.indices && a.sides == b.sides && a.normals == b.normals &&
         a.water_mask == b.water_mask && a.metadata_json == b.metadata_json;
}

QuantizedMesh grid_mesh(std::uint32_t n) {
  // Rows from the south; renumbered by first use afterwards.
  std::vector<std::uint32_t> number_of(std::size_t{n} * n, UINT32_MAX);
  QuantizedMesh mesh;
  const auto use = [&](std::uint32_t column, std::uint32_t row) {
    std::uint32_t& number = number_of[row * n + column];
    if (number == UINT32_MAX) {
      number = static_cast<std::uint32_t>(mesh.u.size());
      mesh.u.push_back(static_cast<std::uint16_t>(column * kQuantizedMax / (n - 1)));
      mesh.v.push_back(static_cast<std::uint16_t>(row * kQuantizedMax / (n - 1)));
      mesh.h.push_back(static_cast<std::uint16_t>((column * 977 + row * 331) % 32768));
    }
    mesh.indices.push_back(number);
  };
  for (std::uint32_t row = 0; row + 1 < n; ++row) {
    for (std::uint32_t column = 0; column + 1 < n; ++column) {
      use(column, row), use(column + 1, row), use(column, row + 1);
      use(column, row + 1), use(column + 1, row), use(column + 1, row + 1);
    }
  }
  for (std::uint32_t i = 0; i < n; ++i) {
    mesh.sides[0].push_back(number_of[i * n]);
    mesh.sides[1].push_back(number_of[i]);
    mesh.sides[2].push_back(number_of[i * n + n - 1]);
    mesh.sides[3].push_back(number_of[(n - 1) * n + i]);
  }
  mesh.header.min_height_m = 10;
  mesh.header.max_height_m = 20;
  return mesh;
}

}  // namespace qmpipe::testing
