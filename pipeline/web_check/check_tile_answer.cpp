#include "pipeline/web_check/check_tile_answer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "formats/bytes/letter_case.h"
#include "scheduler/check.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::web_check {
namespace {

constexpr const char* kMediaType = "application/vnd.quantized-mesh";

void check_media_type(const HttpAnswer& answer, CheckLog& log) {
  const std::optional<std::string> header = answer.header("content-type");
  const std::string whole = lower_case(header.value_or(""));
  const std::string type = whole.substr(0, whole.find_first_of("; "));
  if (type == kMediaType) return;
  const bool is_generic = type == "application/octet-stream" || type.empty();
  log.add(is_generic ? CheckKind::kMediaTypeGeneric : CheckKind::kMediaType, CheckSubject::kTile,
          answer.url,
          header ? fmt::format("\"Content-Type: {}\"", *header) : "there is no Content-Type");
}

void check_extensions(const ServedLayer& layer, const TileKey& key, const QuantizedMesh& mesh,
                      const std::string& url, CheckLog& log) {
  const auto add = [&](CheckKind kind, const std::string& text) {
    log.add(kind, CheckSubject::kTile, url, text);
  };
  const bool lists_normals =
      layer.has_extension("octvertexnormals") || layer.has_extension("vertexnormals");
  if (!mesh.normals.empty() && !lists_normals) {
    add(CheckKind::kNormalsNotListed,
        "the tile carries normals, \"extensions\" does not list octvertexnormals");
  }
  if (mesh.normals.empty() && layer.has_extension("octvertexnormals")) {
    add(CheckKind::kNormalsAbsent,
        "\"extensions\" lists octvertexnormals, the tile carries no normals");
  }
  if (!mesh.water_mask.empty() && !layer.has_extension("watermask")) {
    add(CheckKind::kWaterMaskNotListed,
        "the tile carries a water mask, \"extensions\" does not list watermask");
  }
  const std::optional<std::int32_t>& levels = layer.parsed.metadata_availability;
  if (!levels && mesh.metadata_json) {
    add(CheckKind::kMetadataUnexpected,
        "the tile carries the metadata extension, layer.json has "
        "no \"metadataAvailability\"");
  }
  if (levels && key.zoom % *levels == 0 && !mesh.metadata_json) {
    add(CheckKind::kMetadataAbsent,
        fmt::format("\"metadataAvailability\" is {}, but this tile of zoom {} has no metadata "
                    "extension",
                    *levels, key.zoom));
  }
}

// Around the tile's rectangle between two heights.
Sphere sphere_of(const RectangleDeg& rectangle, double low_m, double high_m) {
  constexpr int kSteps = 8;
  std::vector<Vec3> points;
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const double longitude_deg =
          std::lerp(rectangle.west_deg, rectangle.east_deg, static_cast<double>(i) / kSteps);
      const double latitude_deg =
          std::lerp(rectangle.south_deg, rectangle.north_deg, static_cast<double>(j) / kSteps);
      for (const double height_m : {low_m, high_m}) {
        points.push_back(to_ecef({longitude_deg, latitude_deg, height_m}));
      }
    }
  }
  return bounding_sphere(points);
}

// From the sphere around the tile's rectangle to the header's, centre to centre, in radii of the
// former; infinity where there are no numbers.
double distance_radii(const RectangleDeg& rectangle, const QuantizedMeshHeader& header) {
  const double low_m = header.min_height_m;
  const double high_m = header.max_height_m;
  double distance = std::numeric_limits<double>::infinity();
  if (std::isfinite(low_m) && std::isfinite(high_m)) {
    const Sphere expected = sphere_of(rectangle, low_m, high_m);
    distance = length(minus(header.sphere_centre_ecef_m, expected.centre)) / expected.radius_m;
  }
  return std::isnan(distance) ? std::numeric_limits<double>::infinity() : distance;
}

}  // namespace

std::optional<QuantizedMesh> check_tile_body(const ServedLayer& layer, const TileKey& key,
                                             const HttpAnswer& answer, CheckLog& log) {
  const auto add = [&](CheckKind kind, const std::string& text) {
    log.add(kind, CheckSubject::kTile, answer.url, text);
  };
  const std::optional<std::vector<std::uint8_t>> plain =
      plain_body(answer, CheckSubject::kTile, log);
  if (!plain) return std::nullopt;
  if (is_html(*plain)) {
    add(CheckKind::kTileHtml, "the server answers 200 with a web page");
    return std::nullopt;
  }
  if (plain->empty()) {
    add(CheckKind::kTileEmpty, "the server answers 200 without any bytes");
    return std::nullopt;
  }
  check_media_type(answer, log);
  Result<QuantizedMesh> mesh = decode(*plain);
  if (!mesh) {
    add(has_forbidden_vertex_count(*plain) ? CheckKind::kVertexCount : CheckKind::kTileUnreadable,
        mesh.error().message);
    return std::nullopt;
  }
  check_extensions(layer, key, *mesh, answer.url, log);
  return std::move(*mesh);
}

TileKey mirrored(const TilingScheme& scheme, const TileKey& key) {
  return {.zoom = key.zoom, .x = key.x, .y = scheme.rows(key.zoom) - 1 - key.y};
}

Whereabouts place_of_tile(const TilingScheme& scheme, const TileKey& key,
                          const QuantizedMeshHeader& header) {
  QMPIPE_CHECK(scheme.contains(key));
  const double here = distance_radii(scheme.rectangle_deg(key), header);
  const double mirrored_row = distance_radii(scheme.rectangle_deg(mirrored(scheme, key)), header);
  // The spheres of low zooms reach into their mirrors: the nearer one counts there.
  if (mirrored_row <= 1 && mirrored_row < here / 2) return Whereabouts::kMirroredRow;
  return here <= 1 ? Whereabouts::kHere : Whereabouts::kElsewhere;
}

}  // namespace qmpipe::web_check
