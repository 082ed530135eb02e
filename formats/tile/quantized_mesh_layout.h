// Where things stand in a quantized-mesh file; shared by encode and decode only.
#pragma once

#include <cstddef>
#include <cstdint>

#include "formats/tile/quantized_mesh.h"

namespace qmpipe::detail {

// Header of 88 bytes, then the vertex count.
inline constexpr std::size_t kHeaderBytes = 88;
inline constexpr std::size_t kExtensionHeaderBytes = 5;
inline constexpr std::uint8_t kNormalsId = 1;
inline constexpr std::uint8_t kWaterMaskId = 2;
inline constexpr std::uint8_t kMetadataId = 4;
inline constexpr std::size_t kWaterMaskTexels = std::size_t{256} * 256;

constexpr std::size_t index_bytes(std::size_t vertex_count) {
  return vertex_count > kForbiddenVertexCount ? 4 : 2;
}

// Bytes from `offset` to the next multiple of `alignment` (a power of two).
constexpr std::size_t padding_bytes(std::size_t offset, std::size_t alignment) {
  return (alignment - offset % alignment) % alignment;
}

// 0, -1, 1, -2, 2 ... <-> 0, 1, 2, 3, 4 ...; the difference of two 16-bit values, modulo 65536.
constexpr std::uint16_t zig_zag(std::uint16_t delta) {
  const std::uint32_t wide = delta;
  return static_cast<std::uint16_t>((wide << 1U) ^ ((wide & 0x8000U) != 0 ? 0xFFFFU : 0U));
}
constexpr std::uint16_t un_zig_zag(std::uint16_t code) {
  const std::uint32_t wide = code;
  return static_cast<std::uint16_t>((wide >> 1U) ^ ((wide & 1U) != 0 ? 0xFFFFU : 0U));
}

}  // namespace qmpipe::detail
