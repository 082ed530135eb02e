#include "pipeline/verify/tile.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "formats/tile/oct_normal.h"
#include "formats/tile/tile_set.h"
#include "pipeline/verify/cover.h"
#include "pipeline/verify/visibility.h"
#include "stages/finish/quantize.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::verify {
namespace {

// An occlusion point this far out, in radii, stands for one at infinity.
constexpr double kAsGoodAsInfinite = 1e5;
// A tile's heights that are many metres apart, and those that are so few that it does not matter.
constexpr double kManyHeightsM = 100;
constexpr double kFewHeightsM = 2;
// Sine of the angle by which a two-byte normal may miss the horizon.
constexpr double kHorizonSlack = 0.02;

bool is_finite(const Vec3& a) {
  return std::isfinite(a[0]) && std::isfinite(a[1]) && std::isfinite(a[2]);
}

class MeshCheck {
 public:
  MeshCheck(const TilingScheme& scheme, const TileKey& key, const QuantizedMesh& mesh,
            OcclusionRule rule)
      : key_(key),
        mesh_(mesh),
        header_(mesh.header),
        rule_(rule),
        rectangle_(scheme.rectangle_deg(key)) {}

  std::vector<Finding> run() {
    adopt(check_triangles(mesh_));
    if (check_corners()) adopt(check_cover(mesh_));
    check_duplicates();
    check_unused();
    for (const Side side : kSides) check_side_list(side);
    if (check_heights()) check_places();
    return std::move(findings_);
  }

 private:
  void add(FindingKind kind, std::string text) {
    findings_.push_back({.kind = kind, .key = key_, .text = std::move(text)});
  }
  void adopt(std::vector<Finding> findings) {
    for (Finding& finding : findings) add(finding.kind, std::move(finding.text));
  }

  bool is_on_side(std::uint32_t vertex, Side side) const {
    switch (side) {
      case Side::kWest:
        return mesh_.u[vertex] == 0;
      case Side::kSouth:
        return mesh_.v[vertex] == 0;
      case Side::kEast:
        return mesh_.u[vertex] == kQuantizedMax;
      case Side::kNorth:
        return mesh_.v[vertex] == kQuantizedMax;
    }
    return false;
  }
  std::uint16_t along(std::uint32_t vertex, Side side) const {
    return side == Side::kWest || side == Side::kEast ? mesh_.v[vertex] : mesh_.u[vertex];
  }

  // Whether all four are there.
  bool check_corners();
  void check_duplicates();
  void check_unused();
  void check_side_list(Side side);
  // Whether the heights are numbers that can be worked with.
  bool check_heights();
  void warn_of_loose_range();
  void check_places();
  void check_sphere(const std::vector<Vec3>& positions_ecef);
  void check_occlusion(const std::vector<Vec3>& positions_ecef);
  void check_visibility(const std::vector<Vec3>& positions_ecef);
  void check_centre(const Sphere& smallest);
  void check_normals(const std::vector<Vec3>& positions_ecef);

  TileKey key_;
  const QuantizedMesh& mesh_;
  const QuantizedMeshHeader& header_;
  OcclusionRule rule_;
  RectangleDeg rectangle_;
  std::vector<Finding> findings_;
};

bool MeshCheck::check_corners() {
  std::string missing;
  const auto look_for = [&](int u, int v, const char* name) {
    for (std::size_t k = 0; k < mesh_.vertex_count(); ++k) {
      if (mesh_.u[k] == u && mesh_.v[k] == v) return;
    }
    missing += (missing.empty() ? "" : ", ") + std::string(name);
  };
  look_for(0, 0, "south-west");
  look_for(kQuantizedMax, 0, "south-east");
  look_for(kQuantizedMax, kQuantizedMax, "north-east");
  look_for(0, kQuantizedMax, "north-west");
  if (missing.empty()) return true;
  add(FindingKind::kMissingCorner, "corners without a vertex: " + missing);
  return false;
}

void MeshCheck::check_duplicates() {
  std::vector<std::uint32_t> places;
  places.reserve(mesh_.vertex_count());
  for (std::size_t k = 0; k < mesh_.vertex_count(); ++k) {
    places.push_back(static_cast<std::uint32_t>(mesh_.u[k] << 15U | mesh_.v[k]));
  }
  std::sort(places.begin(), places.end());
  const auto first = std::adjacent_find(places.begin(), places.end());
  if (first == places.end()) return;
  const std::uint32_t place = *first;
  const auto distinct = std::unique(places.begin(), places.end()) - places.begin();
  add(FindingKind::kDuplicateVertex,
      fmt::format(
          "{} of {} vertices stand where another one stands, the first at (u, v) = ({}, {})",
          mesh_.vertex_count() - static_cast<std::size_t>(distinct), mesh_.vertex_count(),
          place >> 15U, place & 0x7FFFU));
}

void MeshCheck::check_unused() {
  std::vector<bool> is_used(mesh_.vertex_count(), false);
  for (const std::uint32_t vertex : mesh_.indices) is_used[vertex] = true;
  const auto unused = std::count(is_used.begin(), is_used.end(), false);
  if (unused == 0) return;
  const auto first = std::find(is_used.begin(), is_used.end(), false) - is_used.begin();
  add(FindingKind::kUnusedVertex, fmt::format("{} of {} vertices are in no triangle, the first is "
                                              "vertex {}",
                                              unused, mesh_.vertex_count(), first));
}

void MeshCheck::check_side_list(Side side) {
  const std::vector<std::uint32_t>& list = mesh_.sides[index_of(side)];
  std::vector<bool> is_listed(mesh_.vertex_count(), false);
  std::int64_t strangers = 0;
  std::int64_t repeats = 0;
  for (const std::uint32_t vertex : list) {
    if (!is_on_side(vertex, side)) ++strangers;
    if (is_listed[vertex]) ++repeats;
    is_listed[vertex] = true;
  }
  std::int64_t missing = 0;
  for (std::uint32_t k = 0; k < mesh_.vertex_count(); ++k) {
    if (is_on_side(k, side) && !is_listed[k]) ++missing;
  }
  const bool is_sorted = std::is_sorted(
      list.begin(), list.end(),
      [&](std::uint32_t a, std::uint32_t b) { return along(a, side) < along(b, side); });
  std::vector<std::string> parts;
  if (missing > 0) parts.push_back(fmt::format("misses {} vertices of the side", missing));
  if (strangers > 0) parts.push_back(fmt::format("names {} that are not on it", strangers));
  if (repeats > 0) parts.push_back(fmt::format("names {} again", repeats));
  // Where strangers stand, the order along the side has no meaning.
  if (!is_sorted && strangers == 0) parts.emplace_back("is not in ascending order");
  if (parts.empty()) return;
  add(FindingKind::kSideList, fmt::format("the {} list of {} vertices {}", name_of(side),
                                          list.size(), fmt::join(parts, "; ")));
}

bool MeshCheck::check_heights() {
  const float low = header_.min_height_m;
  const float high = header_.max_height_m;
  if (!std::isfinite(low) || !std::isfinite(high) || low > high) {
    add(FindingKind::kHeightRange,
        fmt::format("the header's heights run from {} m to {} m", low, high));
    return false;
  }
  warn_of_loose_range();
  return true;
}

// Heights on steps that neighbours share leave some of the range unused: of a tile of over 100 m less
// than 15 % of its own, of a flatter one less than half.
void MeshCheck::warn_of_loose_range() {
  const auto [lowest, highest] = std::minmax_element(mesh_.h.begin(), mesh_.h.end());
  const double header_m = static_cast<double>(header_.max_height_m) - header_.min_height_m;
  const double used_m = header_m * (*highest - *lowest) / kQuantizedMax;
  if (header_m <= (used_m > kManyHeightsM ? 1.15 : 2) * used_m + kFewHeightsM) return;
  add(FindingKind::kLooseHeightRange,
      fmt::format("the vertices use {}..{} of 0..32767: the header's range from {} m to {} m is "
                  "wider than the tile's, which costs precision and early refinement",
                  *lowest, *highest, header_.min_height_m, header_.max_height_m));
}

void MeshCheck::check_places() {
  std::vector<Vec3> positions_ecef;
  positions_ecef.reserve(mesh_.vertex_count());
  for (std::size_t k = 0; k < mesh_.vertex_count(); ++k) {
    positions_ecef.push_back(decoded_position_ecef(mesh_, rectangle_, k));
  }
  check_sphere(positions_ecef);
  check_occlusion(positions_ecef);
  check_visibility(positions_ecef);
  check_normals(positions_ecef);
}

void MeshCheck::check_sphere(const std::vector<Vec3>& positions_ecef) {
  const Sphere smallest = bounding_sphere(positions_ecef);
  check_centre(smallest);
  const Vec3& centre = header_.sphere_centre_ecef_m;
  const double radius_m = header_.sphere_radius_m;
  if (!is_finite(centre) || !std::isfinite(radius_m) || radius_m < 0) {
    add(FindingKind::kBoundingSphere,
        fmt::format("the bounding sphere is no sphere: centre ({}, {}, {}), radius {} m", centre[0],
                    centre[1], centre[2], radius_m));
    return;
  }
  double farthest_m = 0;
  for (const Vec3& p : positions_ecef) farthest_m = std::max(farthest_m, length(minus(p, centre)));
  if (farthest_m > radius_m + std::max(1e-3, 1e-9 * radius_m)) {
    add(FindingKind::kBoundingSphere,
        fmt::format("the bounding sphere's radius is {:.3f} m, but a vertex is {:.3f} m from its "
                    "centre",
                    radius_m, farthest_m));
  } else if (radius_m > 1.5 * smallest.radius_m + 1) {
    add(FindingKind::kOversizedSphere,
        fmt::format("the bounding sphere's radius is {:.1f} m, {:.1f} m would do", radius_m,
                    smallest.radius_m));
  }
}

// Clients do not read it, so only a centre of another place is a fault.
void MeshCheck::check_centre(const Sphere& smallest) {
  const Vec3& centre = header_.centre_ecef_m;
  if (is_finite(centre) && length(minus(centre, smallest.centre)) <= 2 * smallest.radius_m + 1000) {
    return;
  }
  add(FindingKind::kCentre,
      fmt::format("the header's centre ({:.1f}, {:.1f}, {:.1f}) is not at the tile, which lies "
                  "around ({:.1f}, {:.1f}, {:.1f})",
                  centre[0], centre[1], centre[2], smallest.centre[0], smallest.centre[1],
                  smallest.centre[2]));
}

void MeshCheck::check_occlusion(const std::vector<Vec3>& positions_ecef) {
  const Vec3& point = header_.horizon_occlusion_point;
  double magnitude = 0;
  double needed = 0;
  const double largest = std::max({std::abs(point[0]), std::abs(point[1]), std::abs(point[2])});
  if (is_finite(point) && largest > 0) {
    // In two steps: the square of a distance as good as infinite would overflow.
    const Vec3 shortened = scaled(point, 1 / largest);
    magnitude = largest * length(shortened);
    const Vec3 direction = unit(shortened);
    for (const Vec3& p : positions_ecef) {
      const double at_vertex =
          length(p) > 0 ? occlusion_magnitude(direction, p) : kAsGoodAsInfinite;
      needed = std::max(needed, std::min(at_vertex, kAsGoodAsInfinite));
    }
    if (needed <= magnitude * (1 + 1e-9)) return;
  }
  const bool is_read = header_.min_height_m >= 0 || rule_ == OcclusionRule::kAlwaysRight;
  add(is_read ? FindingKind::kOcclusionPoint : FindingKind::kOcclusionIgnored,
      needed > 0 ? fmt::format("the horizon occlusion point is {:.9g} radii from the earth's "
                               "centre; along its ray a vertex needs {:.9g}{}",
                               magnitude, needed,
                               is_read ? "" : " (clients compute their own below height 0)")
                 : fmt::format("the horizon occlusion point is ({}, {}, {})", point[0], point[1],
                               point[2]));
}

void MeshCheck::check_visibility(const std::vector<Vec3>& positions_ecef) {
  const std::optional<HiddenTerrain> hidden = hidden_terrain(header_, rectangle_, positions_ecef);
  if (!hidden) return;
  add(FindingKind::kHiddenTerrain,
      fmt::format("from longitude {:.1f}, latitude {:.1f} at {:.0f} m vertex {} is seen, but "
                  "CesiumJS takes the tile for hidden by the horizon and leaves it out, with all "
                  "tiles below it",
                  hidden->camera.longitude_deg, hidden->camera.latitude_deg,
                  hidden->camera.height_m, hidden->vertex));
}

void MeshCheck::check_normals(const std::vector<Vec3>& positions_ecef) {
  std::int64_t bad = 0;
  std::size_t first = 0;
  for (std::size_t k = mesh_.normals.size(); k-- > 0;) {
    const double distance_m = length(positions_ecef[k]);
    if (distance_m == 0) continue;
    const double up = dot(decode_oct_normal(mesh_.normals[k]), positions_ecef[k]) / distance_m;
    if (up < -kHorizonSlack) {
      ++bad;
      first = k;
    }
  }
  if (bad == 0) return;
  add(FindingKind::kNormalIntoGround,
      fmt::format("{} of {} normals point into the ground, the first is that of vertex {}; they "
                  "must be in the earth-centred frame",
                  bad, mesh_.normals.size(), first));
}

}  // namespace

std::vector<Finding> check_mesh(const TilingScheme& scheme, const TileKey& key,
                                const QuantizedMesh& mesh, OcclusionRule rule) {
  return MeshCheck(scheme, key, mesh, rule).run();
}

CheckedTile check_tile(const TilingScheme& scheme, const TileKey& key,
                       Result<std::vector<std::uint8_t>> stored, OcclusionRule rule) {
  CheckedTile checked;
  const auto refuse = [&](FindingKind kind, const std::string& text) {
    checked.findings.push_back({.kind = kind, .key = key, .text = text});
    return std::move(checked);
  };
  if (!stored) return refuse(FindingKind::kUnreadableTile, stored.error().message);
  const auto plain = plain_tile_bytes(std::move(*stored));
  if (!plain) return refuse(FindingKind::kUnreadableTile, plain.error().message);
  Result<QuantizedMesh> mesh = decode(*plain);
  if (!mesh) {
    return refuse(has_forbidden_vertex_count(*plain) ? FindingKind::kVertexCount
                                                     : FindingKind::kUnreadableTile,
                  mesh.error().message);
  }
  checked.mesh = std::move(*mesh);
  checked.findings = check_mesh(scheme, key, *checked.mesh, rule);
  return checked;
}

}  // namespace qmpipe::verify
