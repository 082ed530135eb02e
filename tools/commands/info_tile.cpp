#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/gzip.h"
#include "formats/tile/mesh_export.h"
#include "formats/tile/oct_normal.h"
#include "formats/tile/quantized_mesh.h"
#include "formats/tile/tile_path.h"
#include "formats/tile_sets/open_tile_set.h"
#include "stages/surface/geodesy.h"
#include "tools/commands/info_report.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct TileFile {
  std::size_t stored_bytes = 0;
  std::size_t plain_bytes = 0;
  bool is_packed = false;
  Result<QuantizedMesh> mesh = Error{};
};

std::string text_of(const TilePlace& place) {
  return place.path.string() + (place.key_in_set ? ": tile " + to_string(*place.key_in_set) : "");
}

Result<std::vector<std::uint8_t>> stored_bytes_of(const TilePlace& place) {
  if (place.key_in_set) return open_tile_set(place.path)->read(*place.key_in_set);
  std::error_code code;
  if (!fs::exists(place.path, code)) {
    throw IoError("cannot open the tile", place.path.string(),
                  code ? code.message() : "there is no such file", "Check the path.");
  }
  return read_file_bytes(place.path, kLargestTileBytes);
}

TileFile read_tile(const TilePlace& place) {
  Result<std::vector<std::uint8_t>> stored = stored_bytes_of(place);
  TileFile file;
  if (!stored) {
    file.mesh = stored.error();
    return file;
  }
  file.stored_bytes = stored->size();
  file.is_packed = is_gzip(*stored);
  const Result<std::vector<std::uint8_t>> plain = plain_tile_bytes(std::move(*stored));
  if (!plain) {
    file.mesh = plain.error();
    return file;
  }
  file.plain_bytes = plain->size();
  file.mesh = decode(*plain);
  return file;
}

double height_m(const QuantizedMesh& mesh, std::uint16_t h) {
  const double low = mesh.header.min_height_m;
  const double high = mesh.header.max_height_m;
  return low + h * (high - low) / kQuantizedMax;
}

std::string text_of(const Vec3& v) { return fmt::format("{:.3f} {:.3f} {:.3f}", v[0], v[1], v[2]); }

int index_width_bits(const QuantizedMesh& mesh) {
  return mesh.vertex_count() > kForbiddenVertexCount ? 32 : 16;
}

std::vector<std::string> extensions_of(const QuantizedMesh& mesh) {
  std::vector<std::string> names;
  if (!mesh.normals.empty()) names.emplace_back("octvertexnormals");
  if (!mesh.water_mask.empty()) names.emplace_back("watermask");
  if (mesh.metadata_json) names.emplace_back("metadata");
  return names;
}

void print_text(const TilePlace& place, const TileFile& file) {
  const QuantizedMesh& mesh = *file.mesh;
  const QuantizedMeshHeader& header = mesh.header;
  const auto [low, high] = std::minmax_element(mesh.h.begin(), mesh.h.end());
  const auto line = [](const char* name, const std::string& value) {
    fmt::print("{:<19}{}\n", name, value);
  };
  line("tile", text_of(place));
  line("stored", fmt::format("{} bytes{}", file.stored_bytes, file.is_packed ? ", gzip" : ""));
  line("plain", fmt::format("{} bytes", file.plain_bytes));
  line("vertices", std::to_string(mesh.vertex_count()));
  line("triangles", std::to_string(mesh.triangle_count()));
  line("index width", fmt::format("{} bits", index_width_bits(mesh)));
  line("side vertices",
       fmt::format("west {}, south {}, east {}, north {}", mesh.sides[0].size(),
                   mesh.sides[1].size(), mesh.sides[2].size(), mesh.sides[3].size()));
  const std::vector<std::string> extensions = extensions_of(mesh);
  line("extensions", extensions.empty() ? "none" : fmt::format("{}", fmt::join(extensions, " ")));
  if (!mesh.water_mask.empty()) {
    line("water mask", fmt::format("{} bytes", mesh.water_mask.size()));
  }
  if (mesh.metadata_json) line("metadata", *mesh.metadata_json);
  line("height in header", fmt::format("{} to {} m", header.min_height_m, header.max_height_m));
  line("height of vertices",
       fmt::format("{:.3f} to {:.3f} m", height_m(mesh, *low), height_m(mesh, *high)));
  line("centre", text_of(header.centre_ecef_m) + " m (ECEF)");
  line("bounding sphere",
       fmt::format("{} m (ECEF), radius {:.3f} m", text_of(header.sphere_centre_ecef_m),
                   header.sphere_radius_m));
  const Vec3& occlusion = header.horizon_occlusion_point;
  line("horizon occlusion", fmt::format("{:.9g} {:.9g} {:.9g} ellipsoid radii", occlusion[0],
                                        occlusion[1], occlusion[2]));
}

void print_json(const TilePlace& place, const TileFile& file) {
  Json document = {{"path", place.path.string()}};
  if (place.key_in_set) document["key"] = to_string(*place.key_in_set);
  document["stored_bytes"] = file.stored_bytes;
  document["plain_bytes"] = file.plain_bytes;
  document["gzip"] = file.is_packed;
  if (!file.mesh) {
    document["error"] = file.mesh.error().message;
  } else {
    const QuantizedMesh& mesh = *file.mesh;
    const QuantizedMeshHeader& header = mesh.header;
    const auto [low, high] = std::minmax_element(mesh.h.begin(), mesh.h.end());
    document["vertices"] = mesh.vertex_count();
    document["triangles"] = mesh.triangle_count();
    document["index_bits"] = index_width_bits(mesh);
    document["side_vertices"] = {{"west", mesh.sides[0].size()},
                                 {"south", mesh.sides[1].size()},
                                 {"east", mesh.sides[2].size()},
                                 {"north", mesh.sides[3].size()}};
    document["extensions"] = extensions_of(mesh);
    document["water_mask_bytes"] = mesh.water_mask.size();
    document["metadata"] = mesh.metadata_json ? Json(*mesh.metadata_json) : Json(nullptr);
    document["header_height_m"] = {header.min_height_m, header.max_height_m};
    document["vertex_height_m"] = {height_m(mesh, *low), height_m(mesh, *high)};
    document["centre_ecef_m"] = header.centre_ecef_m;
    document["sphere_centre_ecef_m"] = header.sphere_centre_ecef_m;
    document["sphere_radius_m"] = header.sphere_radius_m;
    document["horizon_occlusion_point"] = header.horizon_occlusion_point;
  }
  fmt::print("{}\n", document.dump(2, ' ', false, Json::error_handler_t::replace));
}

int report_fault(const TilePlace& place, const std::string& fault) {
  fmt::print(stderr, "qmpipe: {} is no valid tile: {}\n", text_of(place), fault);
  return 1;
}

struct Placement {
  TileKey key;
  RectangleDeg rectangle_deg;
};

// The text of the layer.json that says where the tile lies; none where there is no such file.
std::optional<Result<std::string>> layer_text_of(const TilePlace& place) {
  if (place.key_in_set) return open_tile_set(place.path)->layer_text();
  // zoom/x/y.terrain stands in the folder of layer.json.
  const fs::path path = fs::absolute(place.path).lexically_normal();
  const fs::path layer_path = path.parent_path().parent_path().parent_path() / "layer.json";
  std::error_code code;
  if (!fs::exists(layer_path, code)) return std::nullopt;
  const auto bytes = read_file_bytes(layer_path, kLargestTileBytes);
  if (!bytes) return bytes.error();
  return std::string(bytes->begin(), bytes->end());
}

Placement placement_of(const MeshRequest& request) {
  const TilePlace& place = request.place;
  std::optional<TileKey> key = request.key ? request.key
                               : place.key_in_set
                                   ? place.key_in_set
                                   : parse_tile_path(fs::absolute(place.path).lexically_normal());
  if (!key) {
    throw UsageError(fmt::format("cannot tell from the path which tile {} is; pass --key zoom/x/y",
                                 place.path.string()));
  }
  Projection projection = request.projection.value_or(Projection::kGeodetic);
  const auto text = request.key ? std::nullopt : layer_text_of(place);
  if (text) {
    const auto layer = *text ? parse_layer_json(**text) : Result<ParsedLayerJson>(text->error());
    if (!layer && !request.projection) {
      throw UsageError(fmt::format("the layer.json of {}: {}; pass --projection",
                                   place.path.string(), layer.error().message));
    }
    if (layer && !request.projection) projection = layer->layer.projection;
    if (layer && layer->scheme == "slippyMap" && key->zoom <= kMaxZoom) {
      key->y = TilingScheme(projection).rows(key->zoom) - 1 - key->y;
    }
  }
  const TilingScheme scheme(projection);
  if (!scheme.contains(*key)) {
    throw UsageError(fmt::format(
        "there is no tile {} in the {} scheme; check --key and "
        "--projection",
        to_string(*key), projection == Projection::kGeodetic ? "geodetic" : "mercator"));
  }
  return {.key = *key, .rectangle_deg = scheme.rectangle_deg(*key)};
}

// Rows are the frame's axes in ECEF.
using Axes = std::array<Vec3, 3>;

Axes axes_of(Frame frame, double longitude_deg, double latitude_deg) {
  if (frame == Frame::kEcef) return {Vec3{1, 0, 0}, Vec3{0, 1, 0}, Vec3{0, 0, 1}};
  const Vec3 east = up_at(longitude_deg + 90, 0);
  const Vec3 up = up_at(longitude_deg, latitude_deg);
  return {east, cross(up, east), up};
}

Vec3 turned(const Axes& axes, const Vec3& v) {
  return {dot(axes[0], v), dot(axes[1], v), dot(axes[2], v)};
}

ExportMesh export_mesh_of(const QuantizedMesh& mesh, const RectangleDeg& rectangle, Frame frame) {
  const double centre_longitude_deg = (rectangle.west_deg + rectangle.east_deg) / 2;
  const double centre_latitude_deg = (rectangle.south_deg + rectangle.north_deg) / 2;
  const Axes axes = axes_of(frame, centre_longitude_deg, centre_latitude_deg);
  const Vec3 origin = to_ecef(
      {.longitude_deg = centre_longitude_deg, .latitude_deg = centre_latitude_deg, .height_m = 0});
  ExportMesh result;
  result.indices = mesh.indices;
  for (std::size_t i = 0; i < mesh.vertex_count(); ++i) {
    const double u = mesh.u[i] / static_cast<double>(kQuantizedMax);
    const double v = mesh.v[i] / static_cast<double>(kQuantizedMax);
    const Vec3 position = to_ecef(
        {.longitude_deg = rectangle.west_deg + u * (rectangle.east_deg - rectangle.west_deg),
         .latitude_deg = rectangle.south_deg + v * (rectangle.north_deg - rectangle.south_deg),
         .height_m = height_m(mesh, mesh.h[i])});
    result.positions_m.push_back(turned(axes, minus(position, origin)));
  }
  for (const OctNormal& encoded : mesh.normals) {
    const Vec3 n = turned(axes, decode_oct_normal(encoded));
    result.normals.push_back(
        {static_cast<float>(n[0]), static_cast<float>(n[1]), static_cast<float>(n[2])});
  }
  return result;
}

}  // namespace

int report_tile(const TilePlace& place, ReportStyle style) {
  const TileFile file = read_tile(place);
  if (style == ReportStyle::kJson) {
    print_json(place, file);
  } else if (file.mesh) {
    print_text(place, file);
  }
  return file.mesh ? 0 : report_fault(place, file.mesh.error().message);
}

int write_tile_mesh(const MeshRequest& request) {
  const TileFile file = read_tile(request.place);
  if (!file.mesh) return report_fault(request.place, file.mesh.error().message);
  if (file.mesh->indices.empty()) {
    return report_fault(request.place, "it has no triangles to write");
  }
  const Placement placement = placement_of(request);
  write_mesh_file(request.mesh_path,
                  export_mesh_of(*file.mesh, placement.rectangle_deg, request.frame));
  const RectangleDeg& r = placement.rectangle_deg;
  fmt::print(
      "{}: tile {}, {} vertices, {} triangles; metres, {} axes, origin at longitude {}, "
      "latitude {}\n",
      request.mesh_path.string(), to_string(placement.key), file.mesh->vertex_count(),
      file.mesh->triangle_count(), request.frame == Frame::kEnu ? "east-north-up" : "ECEF",
      (r.west_deg + r.east_deg) / 2, (r.south_deg + r.north_deg) / 2);
  return 0;
}

}  // namespace qmpipe
