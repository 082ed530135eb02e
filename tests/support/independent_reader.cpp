#include "tests/support/independent_reader.h"

#include <cmath>
#include <stdexcept>

namespace independent {
namespace {

// The file as a tape that is read from front to back.
struct Tape {
  const std::vector<std::uint8_t>& file;
  std::size_t position = 0;

  std::uint64_t unsigned_number(int byte_count) {
    std::uint64_t number = 0;
    for (int i = 0; i < byte_count; ++i) {
      if (position >= file.size()) throw std::runtime_error("the file is too short");
      number += static_cast<std::uint64_t>(file[position]) << (8 * i);
      ++position;
    }
    return number;
  }

  // IEEE 754 by its definition: sign, exponent, fraction.
  double floating(int byte_count, int exponent_bits, int fraction_bits) {
    const std::uint64_t bits = unsigned_number(byte_count);
    const std::uint64_t one = 1;
    const double sign = (bits >> (exponent_bits + fraction_bits)) != 0 ? -1.0 : 1.0;
    const int exponent = static_cast<int>((bits >> fraction_bits) & ((one << exponent_bits) - 1));
    const double fraction =
        std::ldexp(static_cast<double>(bits & ((one << fraction_bits) - 1)), -fraction_bits);
    const int bias = (1 << (exponent_bits - 1)) - 1;
    if (exponent == (1 << exponent_bits) - 1) return sign * HUGE_VAL;
    if (exponent == 0) return sign * std::ldexp(fraction, 1 - bias);
    return sign * std::ldexp(1 + fraction, exponent - bias);
  }
  double float64() { return floating(8, 11, 52); }
  float float32() { return static_cast<float>(floating(4, 8, 23)); }

  void doubles(int count, std::vector<double>& to) {
    for (int i = 0; i < count; ++i) to.push_back(float64());
  }

  std::vector<int> zig_zag_array(std::uint64_t count) {
    std::vector<int> values;
    int value = 0;
    for (std::uint64_t i = 0; i < count; ++i) {
      const int code = static_cast<int>(unsigned_number(2));
      value += code % 2 == 0 ? code / 2 : -(code + 1) / 2;
      values.push_back(value);
    }
    return values;
  }

  std::vector<std::uint32_t> index_array(std::uint64_t count, int index_bytes) {
    std::vector<std::uint32_t> indices;
    for (std::uint64_t i = 0; i < count; ++i) {
      indices.push_back(static_cast<std::uint32_t>(unsigned_number(index_bytes)));
    }
    return indices;
  }
};

}  // namespace

Tile read_tile(const std::vector<std::uint8_t>& file) {
  Tape tape{file};
  Tile tile;
  tape.doubles(3, tile.header_doubles);
  tile.minimum_height = tape.float32();
  tile.maximum_height = tape.float32();
  tape.doubles(7, tile.header_doubles);

  const std::uint64_t vertex_count = tape.unsigned_number(4);
  tile.u = tape.zig_zag_array(vertex_count);
  tile.v = tape.zig_zag_array(vertex_count);
  tile.height = tape.zig_zag_array(vertex_count);

  const int index_bytes = vertex_count > 65536 ? 4 : 2;
  while (tape.position % static_cast<std::size_t>(index_bytes) != 0) tape.unsigned_number(1);
  const std::uint64_t triangle_count = tape.unsigned_number(4);
  std::uint32_t highest = 0;
  for (const std::uint32_t code : tape.index_array(3 * triangle_count, index_bytes)) {
    tile.triangles.push_back(highest - code);
    if (code == 0) ++highest;
  }
  for (std::vector<std::uint32_t>* list : {&tile.west, &tile.south, &tile.east, &tile.north}) {
    *list = tape.index_array(tape.unsigned_number(4), index_bytes);
  }

  while (tape.position < file.size()) {
    Tile::Extension extension;
    extension.id = static_cast<int>(tape.unsigned_number(1));
    const std::uint64_t length = tape.unsigned_number(4);
    for (std::uint64_t i = 0; i < length; ++i) {
      extension.bytes += static_cast<char>(tape.unsigned_number(1));
    }
    tile.extensions.push_back(extension);
  }
  return tile;
}

}  // namespace independent
