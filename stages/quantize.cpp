#include "stages/quantize.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "scheduler/check.h"
#include "stages/geodesy.h"

namespace qmpipe {
namespace {

void quantize_heights(std::span<const std::int64_t> steps, double height_step_m,
                      QuantizedMesh& mesh) {
  const auto [low, high] = std::minmax_element(steps.begin(), steps.end());
  const std::int64_t range = *high - *low;
  QMPIPE_CHECK(range <= kQuantizedMax);
  const std::int64_t m = range == 0 ? 0 : kQuantizedMax / range;
  const double min_m = static_cast<double>(*low) * height_step_m;
  mesh.header.min_height_m = static_cast<float>(min_m);
  // A flat tile says min = max, from which any stored height decodes to the same.
  mesh.header.max_height_m = static_cast<float>(
      m == 0 ? min_m : min_m + kQuantizedMax * height_step_m / static_cast<double>(m));
  mesh.h.reserve(steps.size());
  for (const std::int64_t k : steps) mesh.h.push_back(static_cast<std::uint16_t>((k - *low) * m));
}

void list_sides(QuantizedMesh& mesh) {
  for (std::uint32_t k = 0; k < mesh.vertex_count(); ++k) {
    if (mesh.u[k] == 0) mesh.sides[index_of(Side::kWest)].push_back(k);
    if (mesh.v[k] == 0) mesh.sides[index_of(Side::kSouth)].push_back(k);
    if (mesh.u[k] == kQuantizedMax) mesh.sides[index_of(Side::kEast)].push_back(k);
    if (mesh.v[k] == kQuantizedMax) mesh.sides[index_of(Side::kNorth)].push_back(k);
  }
  for (const Side side : kSides) {
    const auto& along = (side == Side::kWest || side == Side::kEast) ? mesh.v : mesh.u;
    auto& list = mesh.sides[index_of(side)];
    std::sort(list.begin(), list.end(),
              [&along](std::uint32_t a, std::uint32_t b) { return along[a] < along[b]; });
  }
}

void fill_globe_fields(const PostGrid& grid, QuantizedMesh& mesh) {
  const RectangleDeg rectangle = {.west_deg = grid.longitude_deg.front(),
                                  .south_deg = grid.latitude_deg.front(),
                                  .east_deg = grid.longitude_deg.back(),
                                  .north_deg = grid.latitude_deg.back()};
  std::vector<Vec3> positions;
  positions.reserve(mesh.vertex_count());
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    positions.push_back(decoded_position_ecef(mesh, rectangle, k));
  }
  QuantizedMeshHeader& header = mesh.header;
  GeoPoint middle = {.longitude_deg = (rectangle.west_deg + rectangle.east_deg) / 2,
                     .latitude_deg = (rectangle.south_deg + rectangle.north_deg) / 2,
                     .height_m = 0};
  // Not through the sphere's centre: that of a tile of a hemisphere is near the earth's, and the
  // direction to it nothing but noise.
  header.horizon_occlusion_point = horizon_occlusion_point(to_ecef(middle), positions);
  middle.height_m = (static_cast<double>(header.min_height_m) + header.max_height_m) / 2;
  header.centre_ecef_m = to_ecef(middle);
  const Sphere sphere = bounding_sphere(positions);
  header.sphere_centre_ecef_m = sphere.centre;
  header.sphere_radius_m = sphere.radius_m;
}

}  // namespace

double decoded_height_m(const QuantizedMesh& mesh, std::size_t vertex) {
  const double low = static_cast<double>(mesh.header.min_height_m);
  const double high = static_cast<double>(mesh.header.max_height_m);
  return low + (high - low) * (mesh.h[vertex] / static_cast<double>(kQuantizedMax));
}

Vec3 decoded_position_ecef(const QuantizedMesh& mesh, const RectangleDeg& rectangle,
                           std::size_t vertex) {
  // As the clients do: a linear mix of the edges, exact at both ends.
  const auto mix = [](double from, double to, std::uint16_t at) {
    const double t = at / static_cast<double>(kQuantizedMax);
    return (1 - t) * from + t * to;
  };
  return to_ecef({.longitude_deg = mix(rectangle.west_deg, rectangle.east_deg, mesh.u[vertex]),
                  .latitude_deg = mix(rectangle.south_deg, rectangle.north_deg, mesh.v[vertex]),
                  .height_m = decoded_height_m(mesh, vertex)});
}

QuantizedMesh quantize(const PostGrid& grid, const Tin& tin, double height_step_m) {
  QMPIPE_CHECK(grid.on_globe() && tin.vertices.size() >= 4);
  QuantizedMesh mesh;
  std::vector<std::int64_t> steps;
  steps.reserve(tin.vertices.size());
  mesh.u.reserve(tin.vertices.size());
  mesh.v.reserve(tin.vertices.size());
  for (const TinVertex& vertex : tin.vertices) {
    steps.push_back(std::llround(vertex.height_m / height_step_m));
    mesh.u.push_back(static_cast<std::uint16_t>(vertex.u));
    mesh.v.push_back(static_cast<std::uint16_t>(vertex.v));
  }
  quantize_heights(steps, height_step_m, mesh);
  mesh.indices = tin.indices;
  list_sides(mesh);
  fill_globe_fields(grid, mesh);
  return mesh;
}

}  // namespace qmpipe
