#include <fmt/format.h>

#include <algorithm>

#include "formats/bytes/little_endian.h"
#include "formats/tile/quantized_mesh.h"
#include "formats/tile/quantized_mesh_layout.h"

namespace qmpipe {
namespace {

using MaybeError = std::optional<Error>;

class MeshDecoder {
 public:
  explicit MeshDecoder(std::span<const std::uint8_t> bytes) : bytes_(bytes) {}

  Result<QuantizedMesh> run() {
    for (const auto step : {&MeshDecoder::read_header, &MeshDecoder::read_vertices,
                            &MeshDecoder::read_indices, &MeshDecoder::read_extensions}) {
      if (MaybeError error = (this->*step)()) return *std::move(error);
    }
    return std::move(mesh_);
  }

 private:
  std::size_t left_bytes() const { return bytes_.size() - at_; }

  // Every take() and every allocation below stands behind one of these.
  MaybeError need(std::uint64_t size, const char* what) const {
    if (size <= left_bytes()) return std::nullopt;
    return Error{fmt::format("the file ends at byte {} within {}, {} of {} bytes are there",
                             bytes_.size(), what, left_bytes(), size)};
  }

  template <class T>
  T take() {
    const T value = load_little_endian<T>(bytes_.data() + at_);
    at_ += sizeof(T);
    return value;
  }
  Vec3 take_vector() {
    Vec3 vector;
    for (double& component : vector) component = take<double>();
    return vector;
  }

  MaybeError read_header() {
    if (MaybeError error = need(detail::kHeaderBytes + 4, "the header")) return error;
    mesh_.header.centre_ecef_m = take_vector();
    mesh_.header.min_height_m = take<float>();
    mesh_.header.max_height_m = take<float>();
    mesh_.header.sphere_centre_ecef_m = take_vector();
    mesh_.header.sphere_radius_m = take<double>();
    mesh_.header.horizon_occlusion_point = take_vector();
    vertex_count_ = take<std::uint32_t>();
    return std::nullopt;
  }

  MaybeError read_vertices() {
    if (vertex_count_ == 0) return Error{"the tile has no vertices"};
    if (vertex_count_ == kForbiddenVertexCount) {
      return Error{"the tile has exactly 65536 vertices, which CesiumJS cannot read"};
    }
    if (MaybeError error = need(std::uint64_t{6} * vertex_count_, "the vertices")) return error;
    mesh_.u = take_deltas();
    mesh_.v = take_deltas();
    mesh_.h = take_deltas();
    if (MaybeError error = check_range(mesh_.u, "u")) return error;
    if (MaybeError error = check_range(mesh_.v, "v")) return error;
    return check_range(mesh_.h, "the height");
  }

  std::vector<std::uint16_t> take_deltas() {
    std::vector<std::uint16_t> values(vertex_count_);
    std::uint16_t value = 0;
    for (std::uint16_t& out : values) {
      value = static_cast<std::uint16_t>(value + detail::un_zig_zag(take<std::uint16_t>()));
      out = value;
    }
    return values;
  }

  // The sums are kept modulo 65536: the first one outside 0..32767 cannot wrap back into it, since
  // one step is at most 32768.
  static MaybeError check_range(const std::vector<std::uint16_t>& values, const char* name) {
    std::uint16_t seen_bits = 0;
    for (const std::uint16_t value : values) seen_bits |= value;
    if (seen_bits <= kQuantizedMax) return std::nullopt;
    const auto bad = std::find_if(values.begin(), values.end(),
                                  [](std::uint16_t value) { return value > kQuantizedMax; });
    return Error{fmt::format("{} of vertex {} lies outside 0..32767", name, bad - values.begin())};
  }

  MaybeError read_indices() {
    const std::size_t width = detail::index_bytes(vertex_count_);
    const std::size_t padding = detail::padding_bytes(at_, width);
    if (MaybeError error = need(padding, "the padding")) return error;
    at_ += padding;
    return width == 4 ? read_indices_of<std::uint32_t>() : read_indices_of<std::uint16_t>();
  }

  template <class Index>
  MaybeError read_indices_of() {
    if (MaybeError error = read_triangles<Index>()) return error;
    constexpr std::array<const char*, 4> kLists = {"the west list", "the south list",
                                                   "the east list", "the north list"};
    for (std::size_t side = 0; side < 4; ++side) {
      if (MaybeError error = read_side<Index>(side, kLists[side])) return error;
    }
    return std::nullopt;
  }

  template <class Index>
  MaybeError read_triangles() {
    if (MaybeError error = need(4, "the triangle count")) return error;
    const std::uint64_t index_count = std::uint64_t{3} * take<std::uint32_t>();
    if (MaybeError error = need(index_count * sizeof(Index), "the triangles")) return error;
    mesh_.indices.resize(index_count);
    std::uint32_t highest = 0;
    for (std::uint32_t& out : mesh_.indices) {
      const std::uint32_t code = take<Index>();
      // With code 0 the index is `highest` itself, and all below it were allowed before.
      if (code > highest || (code == 0 && highest == vertex_count_)) {
        return Error{
            fmt::format("triangle {} has index code {} where the highest index is {} of "
                        "{} vertices",
                        (&out - mesh_.indices.data()) / 3, code, highest, vertex_count_)};
      }
      out = highest - code;
      highest += code == 0 ? 1U : 0U;
    }
    return std::nullopt;
  }

  template <class Index>
  MaybeError read_side(std::size_t side, const char* name) {
    if (MaybeError error = need(4, name)) return error;
    const std::uint32_t count = take<std::uint32_t>();
    if (count > vertex_count_) {
      return Error{fmt::format("{} holds {} indices, but the tile has {} vertices", name, count,
                               vertex_count_)};
    }
    if (MaybeError error = need(std::uint64_t{count} * sizeof(Index), name)) return error;
    mesh_.sides[side].resize(count);
    for (std::uint32_t& out : mesh_.sides[side]) {
      out = take<Index>();
      if (out >= vertex_count_) {
        return Error{fmt::format("{} names vertex {} of {}", name, out, vertex_count_)};
      }
    }
    return std::nullopt;
  }

  MaybeError read_extensions() {
    std::array<bool, 256> seen{};
    while (left_bytes() > 0) {
      if (left_bytes() < detail::kExtensionHeaderBytes) {
        return Error{fmt::format("{} bytes after the last list or extension are no extension",
                                 left_bytes())};
      }
      const std::uint8_t id = take<std::uint8_t>();
      const std::uint32_t size = take<std::uint32_t>();
      if (MaybeError error = need(size, fmt::format("extension {}", id).c_str())) return error;
      if (MaybeError error = read_extension(id, bytes_.subspan(at_, size), seen[id])) return error;
      seen[id] = true;
      at_ += size;
    }
    return std::nullopt;
  }

  MaybeError read_extension(std::uint8_t id, std::span<const std::uint8_t> body, bool is_second) {
    const bool is_known =
        id == detail::kNormalsId || id == detail::kWaterMaskId || id == detail::kMetadataId;
    if (!is_known) return std::nullopt;
    if (is_second) return Error{fmt::format("extension {} is there twice", id)};
    if (id == detail::kNormalsId) return read_normals(body);
    return id == detail::kWaterMaskId ? read_water_mask(body) : read_metadata(body);
  }

  MaybeError read_normals(std::span<const std::uint8_t> body) {
    const std::uint64_t wanted = std::uint64_t{2} * vertex_count_;
    if (body.size() != wanted) {
      return Error{
          fmt::format("the normals extension gives its length as {}, but 2 bytes for each "
                      "of {} vertices make {}",
                      body.size(), vertex_count_, wanted)};
    }
    mesh_.normals.resize(vertex_count_);
    std::memcpy(mesh_.normals.data(), body.data(), body.size());
    return std::nullopt;
  }

  MaybeError read_water_mask(std::span<const std::uint8_t> body) {
    if (body.size() != 1 && body.size() != detail::kWaterMaskTexels) {
      return Error{
          fmt::format("the water mask has {} bytes; 1 or 65536 are possible", body.size())};
    }
    mesh_.water_mask.assign(body.begin(), body.end());
    return std::nullopt;
  }

  MaybeError read_metadata(std::span<const std::uint8_t> body) {
    if (body.size() < 4) {
      return Error{fmt::format("the metadata extension has {} bytes, too few for its text's length",
                               body.size())};
    }
    const std::uint32_t text_bytes = load_little_endian<std::uint32_t>(body.data());
    if (text_bytes != body.size() - 4) {
      return Error{
          fmt::format("the metadata extension gives its text's length as {}, but holds {} "
                      "bytes of text",
                      text_bytes, body.size() - 4)};
    }
    mesh_.metadata_json.emplace(body.begin() + 4, body.end());
    return std::nullopt;
  }

  std::span<const std::uint8_t> bytes_;
  std::size_t at_ = 0;
  std::uint32_t vertex_count_ = 0;
  QuantizedMesh mesh_;
};

}  // namespace

Result<QuantizedMesh> decode(std::span<const std::uint8_t> bytes) {
  return MeshDecoder(bytes).run();
}

bool has_forbidden_vertex_count(std::span<const std::uint8_t> bytes) {
  return bytes.size() >= detail::kHeaderBytes + sizeof(std::uint32_t) &&
         load_little_endian<std::uint32_t>(bytes.data() + detail::kHeaderBytes) ==
             kForbiddenVertexCount;
}

}  // namespace qmpipe
