#include "pipeline/verify/borders.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <string>

#include "stages/finish/quantize.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::verify {
namespace {

struct DecodedBorder {
  std::vector<std::uint16_t> along;
  std::vector<Vec3> points_ecef;
};

// Through decoded_position_ecef(), so that there is one truth about where a vertex is.
DecodedBorder decode_border(const TilingScheme& scheme, const TileKey& key, const TileBorders& tile,
                            Side side) {
  const bool is_vertical = side == Side::kWest || side == Side::kEast;
  const auto across =
      static_cast<std::uint16_t>(side == Side::kEast || side == Side::kNorth ? kQuantizedMax : 0);
  QuantizedMesh mesh;
  mesh.header.min_height_m = tile.min_height_m;
  mesh.header.max_height_m = tile.max_height_m;
  DecodedBorder line;
  for (const BorderVertex& vertex : tile.sides[index_of(side)]) {
    mesh.u.push_back(is_vertical ? across : vertex.along);
    mesh.v.push_back(is_vertical ? vertex.along : across);
    mesh.h.push_back(vertex.h);
    line.along.push_back(vertex.along);
  }
  const RectangleDeg rectangle = scheme.rectangle_deg(key);
  line.points_ecef.reserve(line.along.size());
  for (std::size_t k = 0; k < line.along.size(); ++k) {
    line.points_ecef.push_back(decoded_position_ecef(mesh, rectangle, k));
  }
  return line;
}

// Where the line is at a position along the side; beyond its ends, its end.
// REQUIRES: the line is not empty.
Vec3 point_at(const DecodedBorder& line, std::uint16_t along) {
  const auto after = std::lower_bound(line.along.begin(), line.along.end(), along);
  if (after == line.along.end()) return line.points_ecef.back();
  const auto k = static_cast<std::size_t>(after - line.along.begin());
  if (*after == along || k == 0) return line.points_ecef[k];
  const double t = static_cast<double>(along - line.along[k - 1]) /
                   static_cast<double>(line.along[k] - line.along[k - 1]);
  return plus(scaled(line.points_ecef[k - 1], 1 - t), scaled(line.points_ecef[k], t));
}

struct Crack {
  double width_m = 0;
  std::uint16_t along = 0;
};

Crack largest_crack(const DecodedBorder& a, const DecodedBorder& b) {
  Crack crack;
  if (a.along.empty() || b.along.empty()) return crack;
  const auto look = [&crack](const DecodedBorder& from, const DecodedBorder& to) {
    for (std::size_t k = 0; k < from.along.size(); ++k) {
      const double width_m = length(minus(from.points_ecef[k], point_at(to, from.along[k])));
      if (width_m > crack.width_m) crack = {.width_m = width_m, .along = from.along[k]};
    }
  };
  look(a, b);
  look(b, a);
  return crack;
}

// The first position at which only one of the lines has a vertex.
std::optional<std::uint16_t> first_difference(const DecodedBorder& a, const DecodedBorder& b) {
  const auto [at_a, at_b] =
      std::mismatch(a.along.begin(), a.along.end(), b.along.begin(), b.along.end());
  if (at_a == a.along.end() && at_b == b.along.end()) return std::nullopt;
  if (at_a == a.along.end()) return *at_b;
  if (at_b == b.along.end()) return *at_a;
  return std::min(*at_a, *at_b);
}

struct NormalDifferences {
  std::int64_t count = 0;
  std::uint16_t first_along = 0;
};

// REQUIRES: equal positions on both sides.
NormalDifferences compare_normals(const std::vector<BorderVertex>& a,
                                  const std::vector<BorderVertex>& b) {
  NormalDifferences differences;
  for (std::size_t k = 0; k < a.size(); ++k) {
    if (a[k].normal == b[k].normal) continue;
    if (differences.count++ == 0) differences.first_along = a[k].along;
  }
  return differences;
}

}  // namespace

TileBorders borders_of(const QuantizedMesh& mesh) {
  TileBorders tile;
  tile.min_height_m = mesh.header.min_height_m;
  tile.max_height_m = mesh.header.max_height_m;
  tile.has_normals = !mesh.normals.empty();
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    const OctNormal normal = tile.has_normals ? mesh.normals[k] : OctNormal{};
    const auto put = [&](Side side, std::uint16_t along) {
      tile.sides[index_of(side)].push_back({.along = along, .h = mesh.h[k], .normal = normal});
    };
    if (mesh.u[k] == 0) put(Side::kWest, mesh.v[k]);
    if (mesh.v[k] == 0) put(Side::kSouth, mesh.u[k]);
    if (mesh.u[k] == kQuantizedMax) put(Side::kEast, mesh.v[k]);
    if (mesh.v[k] == kQuantizedMax) put(Side::kNorth, mesh.u[k]);
  }
  for (std::vector<BorderVertex>& side : tile.sides) {
    std::stable_sort(side.begin(), side.end(), [](const BorderVertex& a, const BorderVertex& b) {
      return a.along < b.along;
    });
    const auto end = std::unique(
        side.begin(), side.end(),
        [](const BorderVertex& a, const BorderVertex& b) { return a.along == b.along; });
    side.erase(end, side.end());
    side.shrink_to_fit();
  }
  return tile;
}

BorderComparison compare_borders(const TilingScheme& scheme, const TileKey& key,
                                 const TileBorders& tile, Side side, const TileKey& neighbour_key,
                                 const TileBorders& neighbour) {
  const DecodedBorder here = decode_border(scheme, key, tile, side);
  const DecodedBorder there = decode_border(scheme, neighbour_key, neighbour, opposite(side));
  const Crack crack = largest_crack(here, there);
  BorderComparison comparison;
  comparison.crack_m = crack.width_m;
  const char* axis = side == Side::kWest || side == Side::kEast ? "v" : "u";
  const auto add = [&](FindingKind kind, const std::string& text) {
    comparison.findings.push_back({.kind = kind,
                                   .key = key,
                                   .text = fmt::format("{} side against {}: {}", name_of(side),
                                                       to_string(neighbour_key), text)});
  };
  if (const auto difference = first_difference(here, there)) {
    add(FindingKind::kBorderVertices,
        fmt::format("{} vertices here, {} there, and the first that only one has is at {} = {}; "
                    "the crack is {:.3f} m wide",
                    here.along.size(), there.along.size(), axis, *difference, crack.width_m));
    return comparison;
  }
  if (crack.width_m > kLargestCrackM) {
    add(FindingKind::kCrack, fmt::format("the crack is {:.6f} m wide at {} = {}, more than 1 mm",
                                         crack.width_m, axis, crack.along));
  }
  if (!tile.has_normals || !neighbour.has_normals) return comparison;
  const NormalDifferences normals =
      compare_normals(tile.sides[index_of(side)], neighbour.sides[index_of(opposite(side))]);
  if (normals.count > 0) {
    add(FindingKind::kBorderNormals,
        fmt::format("{} of {} vertices have another normal there, the first at {} = {}",
                    normals.count, here.along.size(), axis, normals.first_along));
  }
  return comparison;
}

}  // namespace qmpipe::verify
