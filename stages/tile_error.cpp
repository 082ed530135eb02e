#include "stages/tile_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/quantize.h"
#include "stages/triangle_scan.h"

namespace qmpipe {
namespace {

// Only covers the rounding of double arithmetic: each post belongs to one triangle, or to two that
// agree on it.
constexpr double kMargin = 1e-6;

IntPoint corner(const QuantizedMesh& mesh, std::uint32_t vertex) {
  return {mesh.u[vertex], mesh.v[vertex]};
}

std::vector<double> surface_at_posts(const PostGrid& grid, const QuantizedMesh& mesh) {
  std::vector<double> surface(kTilePostCount, std::numeric_limits<double>::quiet_NaN());
  for (std::size_t t = 0; t + 2 < mesh.indices.size(); t += 3) {
    const IntPoint a = corner(mesh, mesh.indices[t]);
    const IntPoint b = corner(mesh, mesh.indices[t + 1]);
    const IntPoint c = corner(mesh, mesh.indices[t + 2]);
    if (orientation(a, b, c) <= 0) continue;
    const Plane plane = plane_through(a, b, c, decoded_height_m(mesh, mesh.indices[t]),
                                      decoded_height_m(mesh, mesh.indices[t + 1]),
                                      decoded_height_m(mesh, mesh.indices[t + 2]));
    const auto row_of = [&grid](double v) {
      const auto it = std::lower_bound(grid.v_exact.begin(), grid.v_exact.end(), v);
      return static_cast<std::int32_t>(it - grid.v_exact.begin());
    };
    const std::int32_t j_first = row_of(std::min({a.y, b.y, c.y}) - kMargin);
    const std::int32_t j_last =
        std::min(kTileIntervals, row_of(std::max({a.y, b.y, c.y}) + kMargin));
    scan_triangle(grid, a, b, c, kMargin, j_first, j_last,
                  [&](std::int32_t j, std::int32_t i_first, std::int32_t i_last) {
                    const double v = grid.v_exact[static_cast<std::size_t>(j)];
                    for (std::int32_t i = i_first; i <= i_last; ++i) {
                      surface[static_cast<std::size_t>(tile_post_index(i, j))] =
                          plane.at(grid.u_exact[static_cast<std::size_t>(i)], v);
                    }
                  });
  }
  return surface;
}

void place_vertices(const PostGrid& grid, const QuantizedMesh& mesh, std::vector<double>& surface) {
  for (std::size_t k = 0; k < mesh.vertex_count(); ++k) {
    const auto column = std::lower_bound(grid.u.begin(), grid.u.end(), mesh.u[k]);
    const auto row = std::lower_bound(grid.v.begin(), grid.v.end(), mesh.v[k]);
    if (column == grid.u.end() || *column != mesh.u[k]) continue;
    if (row == grid.v.end() || *row != mesh.v[k]) continue;
    const auto i = static_cast<std::int32_t>(column - grid.u.begin());
    const auto j = static_cast<std::int32_t>(row - grid.v.begin());
    surface[static_cast<std::size_t>(tile_post_index(i, j))] = decoded_height_m(mesh, k);
  }
}

}  // namespace

void ErrorSummary::add(const ErrorSummary& other) {
  if (other.largest_m > largest_m) {
    largest_m = other.largest_m;
    worst = other.worst;
  }
  posts += other.posts;
  sum_m += other.sum_m;
  sum_of_squares_m2 += other.sum_of_squares_m2;
}

double ErrorSummary::mean_m() const { return posts == 0 ? 0 : sum_m / static_cast<double>(posts); }
double ErrorSummary::rms_m() const {
  return posts == 0 ? 0 : std::sqrt(sum_of_squares_m2 / static_cast<double>(posts));
}

ErrorSummary measure_error(const PostGrid& grid, const QuantizedMesh& mesh,
                           std::span<const float> heights_m, std::span<const std::uint8_t> valid) {
  QMPIPE_CHECK(heights_m.size() == kTilePostCount && valid.size() == kTilePostCount);
  std::vector<double> surface = surface_at_posts(grid, mesh);
  place_vertices(grid, mesh, surface);
  ErrorSummary summary;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    if (valid[k] == 0 || std::isnan(surface[k])) continue;
    const double error_m = std::abs(surface[k] - static_cast<double>(heights_m[k]));
    ++summary.posts;
    summary.sum_m += error_m;
    summary.sum_of_squares_m2 += error_m * error_m;
    if (error_m > summary.largest_m) {
      summary.largest_m = error_m;
      const auto post = static_cast<std::int32_t>(k);
      summary.worst = {.i = post % kTilePosts, .j = post / kTilePosts};
    }
  }
  return summary;
}

}  // namespace qmpipe
