// A second reader of quantized-mesh-1.0, written from the specification's text alone. It shares no
// code and no type with formats/, so that it can bear witness. Plain rather than quick; trusts that
// the tile is not hostile. Throws std::runtime_error where the bytes end too early.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace independent {

struct Tile {
  // In the order of the file: centre, sphere centre, sphere radius, occlusion point.
  std::vector<double> header_doubles;
  float minimum_height = 0;
  float maximum_height = 0;
  std::vector<int> u, v, height;
  std::vector<std::uint32_t> triangles;
  std::vector<std::uint32_t> west, south, east, north;

  struct Extension {
    int id = 0;
    std::string bytes;
  };
  std::vector<Extension> extensions;
};

Tile read_tile(const std::vector<std::uint8_t>& file);

}  // namespace independent
