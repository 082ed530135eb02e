#include "pipeline/common/hausdorff.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <random>
#include <utility>
#include <vector>

#include "pipeline/common/nearest_grid.h"
#include "scheduler/check.h"
#include "stages/finish/quantize.h"
#include "stages/surface/delaunay.h"
#include "stages/surface/geodesy.h"
#include "stages/surface/tin.h"

namespace qmpipe {
namespace {

// A step through n points that visits each once and leaps far: the largest distance is met early,
// after which most points are done with the first near enough point (Taha and Hanbury 2015).
std::size_t scattered_step(std::size_t n) {
  std::size_t step = std::max<std::size_t>(1, n * 5 / 8);
  while (std::gcd(step, n) != 1) ++step;
  return step;
}

// The larger one of `at_least` and the largest squared distance from a point to its nearest item.
template <class Item>
double directed_squared(const std::vector<Vec3>& from, std::vector<Item> to, double at_least) {
  const NearestGrid<Item> grid(std::move(to), from);
  const std::size_t step = scattered_step(from.size());
  double largest = at_least;
  std::size_t at = 0;
  for (std::size_t k = 0; k < from.size(); ++k) {
    largest = std::max(largest, grid.nearest_squared(from[at], largest));
    at = (at + step) % from.size();
  }
  return largest;
}

// The standard library's distributions differ between implementations, so these are our own.
class Random {
 public:
  explicit Random(const TileKey& key) : engine_(packed(key)) {}
  double fraction() { return static_cast<double>(engine_() >> 11U) * 0x1p-53; }
  std::size_t below(std::size_t n) { return static_cast<std::size_t>(engine_() % n); }

 private:
  std::mt19937_64 engine_;
};

Vec3 point_on_edge(const Vec3& a, const Vec3& b, Random& random) {
  const double t = random.fraction();
  return plus(scaled(a, 1 - t), scaled(b, t));
}

Vec3 point_on_face(const Vec3& a, const Vec3& b, const Vec3& c, Random& random) {
  double s = random.fraction();
  double t = random.fraction();
  if (s + t > 1) {
    s = 1 - s;
    t = 1 - t;
  }
  return plus(scaled(a, 1 - s - t), plus(scaled(b, s), scaled(c, t)));
}

// Picks the k-th item with a chance of weight[k]. REQUIRES: a positive sum.
std::size_t pick(const std::vector<double>& sums, Random& random) {
  const double at = random.fraction() * sums.back();
  const auto it = std::upper_bound(sums.begin(), sums.end(), at);
  return static_cast<std::size_t>(std::min(it, sums.end() - 1) - sums.begin());
}

IntPoint corner(const QuantizedMesh& mesh, std::uint32_t vertex) {
  return {.x = mesh.u[vertex], .y = mesh.v[vertex]};
}

void add_points_on_faces(const QuantizedMesh& mesh, Random& random, std::vector<Vec3>& points) {
  std::vector<double> sums;
  double sum = 0;
  for (std::size_t k = 0; k + 2 < mesh.indices.size(); k += 3) {
    sum += std::abs(static_cast<double>(orientation(corner(mesh, mesh.indices[k]),
                                                    corner(mesh, mesh.indices[k + 1]),
                                                    corner(mesh, mesh.indices[k + 2]))));
    sums.push_back(sum);
  }
  if (sum == 0) return;
  for (int k = 0; k < kRandomPointsOnFaces; ++k) {
    const std::uint32_t* face = &mesh.indices[3 * pick(sums, random)];
    points.push_back(point_on_face(points[face[0]], points[face[1]], points[face[2]], random));
  }
}

void add_points_on_edges(const QuantizedMesh& mesh, Random& random, std::vector<Vec3>& points) {
  std::vector<std::pair<std::uint32_t, std::uint32_t>> edges;
  for (std::size_t k = 0; k < mesh.indices.size(); ++k) {
    const std::size_t next = k % 3 == 2 ? k - 2 : k + 1;
    edges.push_back(std::minmax({mesh.indices[k], mesh.indices[next]}));
  }
  std::sort(edges.begin(), edges.end());
  edges.erase(std::unique(edges.begin(), edges.end()), edges.end());
  std::vector<double> sums;
  double sum = 0;
  for (const auto& [from, to] : edges) {
    const IntPoint a = corner(mesh, from);
    const IntPoint b = corner(mesh, to);
    const double du = a.x - b.x;
    const double dv = a.y - b.y;
    sum += std::sqrt(du * du + dv * dv);
    sums.push_back(sum);
  }
  if (sum == 0) return;
  for (int k = 0; k < kRandomPointsOnEdges; ++k) {
    const auto& [from, to] = edges[pick(sums, random)];
    points.push_back(point_on_edge(points[from], points[to], random));
  }
}

std::vector<Vec3> points_of_tile(const RectangleDeg& rectangle, const QuantizedMesh& mesh,
                                 Random& random) {
  std::vector<Vec3> points;
  points.reserve(mesh.vertex_count() + kRandomPointsOnFaces + kRandomPointsOnEdges);
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    points.push_back(decoded_position_ecef(mesh, rectangle, k));
  }
  add_points_on_faces(mesh, random, points);
  add_points_on_edges(mesh, random, points);
  return points;
}

std::vector<Vec3> points_of_lattice(const PostGrid& grid, std::span<const float> heights_m,
                                    Random& random) {
  std::vector<Vec3> points;
  points.reserve(kTilePostCount + kRandomPointsOnFaces + kRandomPointsOnEdges);
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    points.push_back(to_ecef({.longitude_deg = grid.longitude_deg[k % kTilePosts],
                              .latitude_deg = grid.latitude_deg[k / kTilePosts],
                              .height_m = static_cast<double>(heights_m[k])}));
  }
  const auto at = [](std::size_t i, std::size_t j) { return j * kTilePosts + i; };
  for (int k = 0; k < kRandomPointsOnFaces; ++k) {
    const std::size_t i = random.below(kTileIntervals);
    const std::size_t j = random.below(kTileIntervals);
    const std::size_t third = random.below(2) == 0 ? at(i + 1, j) : at(i, j + 1);
    points.push_back(
        point_on_face(points[at(i, j)], points[at(i + 1, j + 1)], points[third], random));
  }
  for (int k = 0; k < kRandomPointsOnEdges; ++k) {
    // To the east, to the north, or along the diagonal.
    const std::size_t kind = random.below(3);
    const std::size_t i = random.below(kind == 1 ? kTilePosts : kTileIntervals);
    const std::size_t j = random.below(kind == 0 ? kTilePosts : kTileIntervals);
    const std::size_t end = at(kind == 1 ? i : i + 1, kind == 0 ? j : j + 1);
    points.push_back(point_on_edge(points[at(i, j)], points[end], random));
  }
  return points;
}

std::vector<Triangle> triangles_of_tile(const QuantizedMesh& mesh,
                                        const std::vector<Vec3>& points) {
  std::vector<Triangle> triangles;
  triangles.reserve(mesh.triangle_count());
  for (std::size_t k = 0; k + 2 < mesh.indices.size(); k += 3) {
    triangles.push_back(
        {points[mesh.indices[k]], points[mesh.indices[k + 1]], points[mesh.indices[k + 2]]});
  }
  return triangles;
}

std::vector<Triangle> triangles_of_lattice(const std::vector<Vec3>& points) {
  std::vector<Triangle> triangles;
  triangles.reserve(static_cast<std::size_t>(2) * kTileIntervals * kTileIntervals);
  for (std::size_t j = 0; j < kTileIntervals; ++j) {
    for (std::size_t i = 0; i < kTileIntervals; ++i) {
      const std::size_t at = j * kTilePosts + i;
      const Vec3& south_west = points[at];
      const Vec3& north_east = points[at + kTilePosts + 1];
      triangles.push_back({south_west, points[at + 1], north_east});
      triangles.push_back({south_west, north_east, points[at + kTilePosts]});
    }
  }
  return triangles;
}

// In one frame; the points of a mesh start with its vertices.
double between_points_squared(const std::vector<Vec3>& a, const std::vector<Vec3>& b) {
  // The smaller set first: its few searches raise the bar for the many of the larger one.
  if (a.size() > b.size()) return between_points_squared(b, a);
  return directed_squared(b, a, directed_squared(a, b, 0));
}

}  // namespace

double hausdorff_between_points_m(std::span<const Vec3> a, std::span<const Vec3> b) {
  QMPIPE_CHECK(!a.empty() && !b.empty());
  const GroundFrame frame(a);
  return std::sqrt(between_points_squared(frame.turned(a), frame.turned(b)));
}

HausdorffDistances tile_hausdorff(const TilingScheme& scheme, const TileKey& key,
                                  const QuantizedMesh& mesh, std::span<const float> heights_m) {
  QMPIPE_CHECK(heights_m.size() == kTilePostCount && mesh.triangle_count() > 0);
  Random random(key);
  std::vector<Vec3> tile = points_of_tile(scheme.rectangle_deg(key), mesh, random);
  std::vector<Vec3> lattice = points_of_lattice(make_tile_grid(scheme, key), heights_m, random);
  const GroundFrame frame(lattice);
  tile = frame.turned(tile);
  lattice = frame.turned(lattice);
  const double from_tile = directed_squared(tile, triangles_of_lattice(lattice), 0);
  const double surfaces = directed_squared(lattice, triangles_of_tile(mesh, tile), from_tile);
  return {.to_surfaces_m = std::sqrt(surfaces),
          .between_points_m = std::sqrt(between_points_squared(tile, lattice))};
}

}  // namespace qmpipe
