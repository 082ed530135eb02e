#include "stages/finish/quantize.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <span>

#include "scheduler/check.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {

// Two tiles may round to either side of a vertex that they share: less than a millimetre together.
constexpr double kLargestRoundingM = 0.00049;
constexpr std::int64_t kMostShift = 64;

// What the header says of heights, and how many units an inner step has.
struct HeightScale {
  double min_m = 0;
  double max_m = 0;
  std::int64_t units = 0;
};

double rounding_m(double height_m) {
  return std::abs(static_cast<double>(static_cast<float>(height_m)) - height_m);
}

// `lowest_side`: the lowest vertex, down to a step of the sides; `range`: from there, in inner steps.
HeightScale height_scale(std::int64_t lowest_side, std::int64_t range, const HeightSteps& steps) {
  HeightScale best;
  double least_rounding_m = std::numeric_limits<double>::infinity();
  for (std::int64_t units = kQuantizedMax / range; units > 0; --units) {
    // Lower minima shift the maximum to other places between two floats.
    for (std::int64_t down = 0; down < kMostShift; ++down) {
      if ((range + down * steps.parts) * units > kQuantizedMax) break;
      const double min_m = static_cast<double>(lowest_side - down) * steps.side_m;
      const double max_m = min_m + kQuantizedMax * steps.inner_m / static_cast<double>(units);
      const double rounded_m = rounding_m(max_m);
      if (rounded_m < least_rounding_m) {
        least_rounding_m = rounded_m;
        best = {.min_m = min_m, .max_m = max_m, .units = units};
      }
      if (least_rounding_m <= kLargestRoundingM) return best;
    }
  }
  return best;
}

void quantize_heights(std::span<const std::int64_t> inner, const HeightSteps& steps,
                      QuantizedMesh& mesh) {
  const auto [low, high] = std::minmax_element(inner.begin(), inner.end());
  const std::int64_t lowest_side = static_cast<std::int64_t>(
      std::floor(static_cast<double>(*low) / static_cast<double>(steps.parts)));
  const std::int64_t range = *high - lowest_side * steps.parts;
  QMPIPE_CHECK(range <= kQuantizedMax);
  HeightScale scale{.min_m = static_cast<double>(lowest_side) * steps.side_m};
  // A flat tile says min = max, from which any stored height decodes to the same.
  scale.max_m = scale.min_m;
  if (range > 0) scale = height_scale(lowest_side, range, steps);
  mesh.header.min_height_m = static_cast<float>(scale.min_m);
  mesh.header.max_height_m = static_cast<float>(scale.max_m);
  const auto base = static_cast<std::int64_t>(std::llround(scale.min_m / steps.inner_m));
  mesh.h.reserve(inner.size());
  for (const std::int64_t k : inner) {
    mesh.h.push_back(static_cast<std::uint16_t>((k - base) * scale.units));
  }
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

QuantizedMesh quantize(const PostGrid& grid, const Tin& tin, const HeightSteps& height_steps) {
  QMPIPE_CHECK(grid.on_globe() && tin.vertices.size() >= 4);
  QuantizedMesh mesh;
  std::vector<std::int64_t> steps;
  steps.reserve(tin.vertices.size());
  mesh.u.reserve(tin.vertices.size());
  mesh.v.reserve(tin.vertices.size());
  for (const TinVertex& vertex : tin.vertices) {
    steps.push_back(std::llround(vertex.height_m / height_steps.inner_m));
    mesh.u.push_back(static_cast<std::uint16_t>(vertex.u));
    mesh.v.push_back(static_cast<std::uint16_t>(vertex.v));
  }
  quantize_heights(steps, height_steps, mesh);
  mesh.indices = tin.indices;
  list_sides(mesh);
  fill_globe_fields(grid, mesh);
  return mesh;
}

}  // namespace qmpipe
