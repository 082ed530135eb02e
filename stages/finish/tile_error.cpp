#include "stages/finish/tile_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/finish/quantize.h"
#include "stages/surface/triangle_scan.h"

namespace qmpipe {
namespace {

// What both kinds of mesh come down to.
struct Surface {
  std::vector<IntPoint> places;
  std::vector<double> heights_m;
  std::vector<std::int32_t> posts;  // that the vertices are, or kNoPost
  std::span<const std::uint32_t> indices;
};

Surface surface_of(const PostGrid& grid, const QuantizedMesh& mesh) {
  Surface surface;
  surface.indices = mesh.indices;
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    surface.places.push_back({mesh.u[k], mesh.v[k]});
    surface.heights_m.push_back(decoded_height_m(mesh, k));
    surface.posts.push_back(post_at(grid, surface.places.back().x, surface.places.back().y));
  }
  return surface;
}

Surface surface_of(const Tin& tin) {
  Surface surface;
  surface.indices = tin.indices;
  for (const TinVertex& vertex : tin.vertices) {
    surface.places.push_back({vertex.u, vertex.v});
    surface.heights_m.push_back(vertex.height_m);
    surface.posts.push_back(vertex.post);
  }
  return surface;
}

// NaN where no triangle is.
std::vector<double> heights_at_posts(const PostGrid& grid, const Surface& surface) {
  std::vector<double> heights(grid.post_count(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t t = 0; t + 2 < surface.indices.size(); t += 3) {
    const std::size_t vertices[3] = {surface.indices[t], surface.indices[t + 1],
                                     surface.indices[t + 2]};
    const IntPoint a = surface.places[vertices[0]];
    const IntPoint b = surface.places[vertices[1]];
    const IntPoint c = surface.places[vertices[2]];
    if (orientation(a, b, c) <= 0) continue;
    const Plane plane =
        plane_through(a, b, c, surface.heights_m[vertices[0]], surface.heights_m[vertices[1]],
                      surface.heights_m[vertices[2]]);
    const PostRows rows = rows_of_triangle(grid, a, b, c, kRoundingMargin);
    scan_triangle(grid, a, b, c, kRoundingMargin, rows.first, rows.last,
                  [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
                    const double v = grid.v_exact[static_cast<std::size_t>(j)];
                    for (std::int32_t i = i_first; i <= i_last; ++i) {
                      heights[static_cast<std::size_t>(grid.index(i, j))] =
                          plane.at(grid.u_exact[static_cast<std::size_t>(i)], v);
                    }
                  });
  }
  return heights;
}

// A post that is a vertex counts where the file puts that: places are rounded to the tile's 32,768.
void put_vertices(const Surface& surface, std::vector<double>& heights) {
  for (std::size_t k = 0; k < surface.posts.size(); ++k) {
    if (surface.posts[k] == kNoPost) continue;
    heights[static_cast<std::size_t>(surface.posts[k])] = surface.heights_m[k];
  }
}

ErrorSummary measure(const PostGrid& grid, const Surface& surface, std::span<const float> heights_m,
                     std::span<const std::uint8_t> valid) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count() && valid.size() == grid.post_count());
  std::vector<double> heights = heights_at_posts(grid, surface);
  ErrorSummary summary;
  for (std::size_t k = 0; k < heights.size(); ++k) {
    if (valid[k] == 0 || std::isnan(heights[k])) continue;
    const double error_m = std::abs(heights[k] - static_cast<double>(heights_m[k]));
    summary.largest_in_place_m = std::max(summary.largest_in_place_m, error_m);
  }
  put_vertices(surface, heights);
  for (std::size_t k = 0; k < heights.size(); ++k) {
    if (valid[k] == 0 || std::isnan(heights[k])) continue;
    const double error_m = std::abs(heights[k] - static_cast<double>(heights_m[k]));
    summary.count(error_m);
    if (error_m > summary.largest_m) {
      summary.largest_m = error_m;
      const auto post = static_cast<std::int32_t>(k);
      summary.worst = {.i = grid.column(post), .j = grid.row(post)};
    }
  }
  return summary;
}

}  // namespace

void ErrorSummary::count(double error_m) {
  ++posts;
  sum_m += error_m;
  sum_of_squares_m2 += error_m * error_m;
}

void ErrorSummary::add(const ErrorSummary& other) {
  if (other.largest_m > largest_m) {
    largest_m = other.largest_m;
    worst = other.worst;
  }
  largest_in_place_m = std::max(largest_in_place_m, other.largest_in_place_m);
  posts += other.posts;
  sum_m += other.sum_m;
  sum_of_squares_m2 += other.sum_of_squares_m2;
}

double ErrorSummary::mean_m() const { return posts == 0 ? 0 : sum_m / static_cast<double>(posts); }
double ErrorSummary::rms_m() const {
  return posts == 0 ? 0 : std::sqrt(sum_of_squares_m2 / static_cast<double>(posts));
}

std::vector<double> surface_at_posts(const PostGrid& grid, const QuantizedMesh& mesh) {
  const Surface surface = surface_of(grid, mesh);
  std::vector<double> heights = heights_at_posts(grid, surface);
  put_vertices(surface, heights);
  return heights;
}

ErrorSummary measure_error(const PostGrid& grid, const QuantizedMesh& mesh,
                           std::span<const float> heights_m, std::span<const std::uint8_t> valid) {
  return measure(grid, surface_of(grid, mesh), heights_m, valid);
}

ErrorSummary measure_error(const PostGrid& grid, const Tin& tin, std::span<const float> heights_m,
                           std::span<const std::uint8_t> valid) {
  return measure(grid, surface_of(tin), heights_m, valid);
}

}  // namespace qmpipe
