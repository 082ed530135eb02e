#include <algorithm>
#include <limits>

#include "formats/bytes/little_endian.h"
#include "formats/tile/quantized_mesh.h"
#include "formats/tile/quantized_mesh_layout.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

std::size_t encoded_size_bytes(const QuantizedMesh& mesh) {
  const std::size_t width = detail::index_bytes(mesh.vertex_count());
  std::size_t size = detail::kHeaderBytes + 4 + 6 * mesh.vertex_count();
  size += detail::padding_bytes(size, width);
  size += 4 + width * mesh.indices.size();
  for (const std::vector<std::uint32_t>& side : mesh.sides) size += 4 + width * side.size();
  if (!mesh.normals.empty()) size += detail::kExtensionHeaderBytes + 2 * mesh.normals.size();
  if (!mesh.water_mask.empty()) size += detail::kExtensionHeaderBytes + mesh.water_mask.size();
  if (mesh.metadata_json) size += detail::kExtensionHeaderBytes + 4 + mesh.metadata_json->size();
  return size;
}

void check_shape(const QuantizedMesh& mesh) {
  const std::size_t n = mesh.vertex_count();
  constexpr std::size_t kMaxCount = std::numeric_limits<std::uint32_t>::max();
  QMPIPE_CHECK(n >= 1 && n <= kMaxCount);
  QMPIPE_CHECK(n != kForbiddenVertexCount);
  QMPIPE_CHECK(mesh.v.size() == n && mesh.h.size() == n);
  QMPIPE_CHECK(mesh.indices.size() % 3 == 0 && mesh.triangle_count() <= kMaxCount);
  QMPIPE_CHECK(mesh.normals.empty() || mesh.normals.size() == n);
  QMPIPE_CHECK(mesh.water_mask.size() <= 1 || mesh.water_mask.size() == detail::kWaterMaskTexels);
  QMPIPE_CHECK(!mesh.metadata_json || mesh.metadata_json->size() <= kMaxCount - 4);
  for (const std::vector<std::uint32_t>& side : mesh.sides) QMPIPE_CHECK(side.size() <= n);
}

// Fills bytes that were sized beforehand.
class Writer {
 public:
  explicit Writer(std::size_t size_bytes) : bytes_(size_bytes) {}

  template <class T>
  void put(T value) {
    store_little_endian(bytes_.data() + at_, value);
    at_ += sizeof(T);
  }
  void put(const Vec3& vector) {
    for (const double component : vector) put(component);
  }
  void put_bytes(const void* data, std::size_t size) {
    if (size == 0) return;
    std::memcpy(bytes_.data() + at_, data, size);
    at_ += size;
  }
  void pad(std::size_t alignment) { at_ += detail::padding_bytes(at_, alignment); }

  void put_header(const QuantizedMeshHeader& header) {
    put(header.centre_ecef_m);
    put(header.min_height_m);
    put(header.max_height_m);
    put(header.sphere_centre_ecef_m);
    put(header.sphere_radius_m);
    put(header.horizon_occlusion_point);
  }

  void put_deltas(const std::vector<std::uint16_t>& values) {
    std::uint16_t previous = 0;
    std::uint16_t seen_bits = 0;
    for (const std::uint16_t value : values) {
      put(detail::zig_zag(static_cast<std::uint16_t>(value - previous)));
      seen_bits |= value;
      previous = value;
    }
    QMPIPE_CHECK(seen_bits <= kQuantizedMax);
  }

  template <class Index>
  void put_triangles(const QuantizedMesh& mesh) {
    put(static_cast<std::uint32_t>(mesh.triangle_count()));
    std::uint32_t highest = 0;
    bool in_first_use_order = true;
    for (const std::uint32_t index : mesh.indices) {
      in_first_use_order &= index <= highest;
      put(static_cast<Index>(highest - index));
      highest += index == highest ? 1U : 0U;
    }
    QMPIPE_CHECK(in_first_use_order);
    QMPIPE_CHECK(highest <= mesh.vertex_count());
  }

  template <class Index>
  void put_side(const std::vector<std::uint32_t>& side, std::size_t vertex_count) {
    put(static_cast<std::uint32_t>(side.size()));
    for (const std::uint32_t index : side) {
      QMPIPE_CHECK(index < vertex_count);
      put(static_cast<Index>(index));
    }
  }

  template <class Index>
  void put_indices(const QuantizedMesh& mesh) {
    pad(sizeof(Index));
    put_triangles<Index>(mesh);
    for (const std::vector<std::uint32_t>& side : mesh.sides) {
      put_side<Index>(side, mesh.vertex_count());
    }
  }

  void put_extension_header(std::uint8_t id, std::size_t size) {
    put(id);
    put(static_cast<std::uint32_t>(size));
  }

  std::vector<std::uint8_t> take() {
    QMPIPE_CHECK(at_ == bytes_.size());
    return std::move(bytes_);
  }

 private:
  std::vector<std::uint8_t> bytes_;
  std::size_t at_ = 0;
};

void put_extensions(const QuantizedMesh& mesh, Writer& writer) {
  if (!mesh.normals.empty()) {
    writer.put_extension_header(detail::kNormalsId, 2 * mesh.normals.size());
    static_assert(sizeof(OctNormal) == 2);
    writer.put_bytes(mesh.normals.data(), 2 * mesh.normals.size());
  }
  if (!mesh.water_mask.empty()) {
    writer.put_extension_header(detail::kWaterMaskId, mesh.water_mask.size());
    writer.put_bytes(mesh.water_mask.data(), mesh.water_mask.size());
  }
  if (mesh.metadata_json) {
    writer.put_extension_header(detail::kMetadataId, 4 + mesh.metadata_json->size());
    writer.put(static_cast<std::uint32_t>(mesh.metadata_json->size()));
    writer.put_bytes(mesh.metadata_json->data(), mesh.metadata_json->size());
  }
}

}  // namespace

std::vector<std::uint8_t> encode(const QuantizedMesh& mesh) {
  check_shape(mesh);
  Writer writer(encoded_size_bytes(mesh));
  writer.put_header(mesh.header);
  writer.put(static_cast<std::uint32_t>(mesh.vertex_count()));
  writer.put_deltas(mesh.u);
  writer.put_deltas(mesh.v);
  writer.put_deltas(mesh.h);
  if (detail::index_bytes(mesh.vertex_count()) == 4) {
    writer.put_indices<std::uint32_t>(mesh);
  } else {
    writer.put_indices<std::uint16_t>(mesh);
  }
  put_extensions(mesh, writer);
  return writer.take();
}

}  // namespace qmpipe
