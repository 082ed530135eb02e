#include "stages/finish/finer_error.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "scheduler/check.h"
#include "stages/finish/quantize.h"
#include "stages/surface/triangle_scan.h"

namespace qmpipe {
namespace {

// Where the posts of a window lie in the tile's quantized frame.
struct WindowFrame {
  double u_first = 0;
  double u_step = 0;
  std::int32_t width_posts = 0;
  std::vector<double> v;

  // The columns with from <= u <= to, none where the first one is beyond the last.
  std::pair<std::int32_t, std::int32_t> columns(double from, double to) const {
    const double last = width_posts - 1;
    const double a = std::clamp(std::ceil((from - u_first) / u_step), 0.0, last + 1);
    const double b = std::clamp(std::floor((to - u_first) / u_step), -1.0, last);
    return {static_cast<std::int32_t>(a), static_cast<std::int32_t>(b)};
  }
};

WindowFrame frame_of(const TilingScheme& scheme, const TileKey& key, std::int32_t zoom,
                     const PostWindow& window) {
  const std::int64_t posts_per_side = std::int64_t{kTileIntervals} << (zoom - key.zoom);
  const std::int64_t i0 = key.x * posts_per_side;
  const std::int64_t j0 = key.y * posts_per_side;
  const Lattice lattice(scheme, zoom);
  const double south_deg = lattice.latitude_deg(j0);
  const double height_deg = lattice.latitude_deg(j0 + posts_per_side) - south_deg;
  WindowFrame frame;
  frame.u_step = static_cast<double>(kQuantizedMax) / static_cast<double>(posts_per_side);
  frame.u_first = static_cast<double>(window.i0 - i0) * frame.u_step;
  frame.width_posts = window.width_posts;
  for (std::int32_t j = 0; j < window.height_posts; ++j) {
    // As clients have it: linear in latitude, whatever the scheme.
    frame.v.push_back(scheme.projection() == Projection::kGeodetic
                          ? static_cast<double>(window.j0 + j - j0) * frame.u_step
                          : (lattice.latitude_deg(window.j0 + j) - south_deg) / height_deg *
                                kQuantizedMax);
  }
  return frame;
}

// How far the triangle reaches in u at a height v of the frame; empty where it does not.
struct Reach {
  double from = std::numeric_limits<double>::infinity();
  double to = -std::numeric_limits<double>::infinity();
};
Reach reach_at(const IntPoint (&corners)[3], double v) {
  Reach reach;
  for (int k = 0; k < 3; ++k) {
    const IntPoint& a = corners[k];
    const IntPoint& b = corners[(k + 1) % 3];
    const double low = static_cast<double>(std::min(a.y, b.y)) - kRoundingMargin;
    const double high = static_cast<double>(std::max(a.y, b.y)) + kRoundingMargin;
    if (v < low || v > high) continue;
    const auto take = [&reach](double u) {
      reach.from = std::min(reach.from, u - kRoundingMargin);
      reach.to = std::max(reach.to, u + kRoundingMargin);
    };
    if (a.y == b.y) {
      take(static_cast<double>(a.x));
      take(static_cast<double>(b.x));
      continue;
    }
    const double t =
        std::clamp((v - static_cast<double>(a.y)) / static_cast<double>(b.y - a.y), 0.0, 1.0);
    take(static_cast<double>(a.x) + t * static_cast<double>(b.x - a.x));
  }
  return reach;
}

}  // namespace

TileSurface::TileSurface(const TilingScheme& scheme, const TileKey& key, const QuantizedMesh& mesh)
    : scheme_(scheme), key_(key) {
  for (std::size_t t = 0; t + 2 < mesh.indices.size(); t += 3) {
    Triangle triangle;
    double heights_m[3];
    for (std::size_t k = 0; k < 3; ++k) {
      const std::size_t vertex = mesh.indices[t + k];
      triangle.corners[k] = {mesh.u[vertex], mesh.v[vertex]};
      heights_m[k] = decoded_height_m(mesh, vertex);
    }
    const auto& [a, b, c] = triangle.corners;
    if (orientation(a, b, c) <= 0) continue;
    triangle.plane = plane_through(a, b, c, heights_m[0], heights_m[1], heights_m[2]);
    triangles_.push_back(triangle);
  }
}

ErrorSummary TileSurface::error(std::int32_t zoom, const PostWindow& window,
                                std::span<const float> heights_m) const {
  QMPIPE_CHECK(zoom >= key_.zoom && heights_m.size() == window.size());
  const WindowFrame frame = frame_of(scheme_, key_, zoom, window);
  // A post on a common edge of two triangles counts once.
  std::vector<double> surface_m(window.size(), std::numeric_limits<double>::quiet_NaN());
  for (const Triangle& triangle : triangles_) {
    const auto& [a, b, c] = triangle.corners;
    const auto row_of = [&frame](double v) {
      return std::lower_bound(frame.v.begin(), frame.v.end(), v) - frame.v.begin();
    };
    const auto first = row_of(static_cast<double>(std::min({a.y, b.y, c.y})) - kRoundingMargin);
    const auto end = row_of(static_cast<double>(std::max({a.y, b.y, c.y})) + kRoundingMargin);
    for (auto j = first; j < end; ++j) {
      const double v = frame.v[static_cast<std::size_t>(j)];
      const Reach reach = reach_at(triangle.corners, v);
      const auto [i_first, i_last] = frame.columns(reach.from, reach.to);
      double* row = surface_m.data() + j * window.width_posts;
      for (std::int32_t i = i_first; i <= i_last; ++i) {
        row[i] = triangle.plane.at(frame.u_first + i * frame.u_step, v);
      }
    }
  }
  ErrorSummary summary;
  for (std::size_t k = 0; k < surface_m.size(); ++k) {
    if (std::isnan(heights_m[k]) || std::isnan(surface_m[k])) continue;
    const double error_m = std::abs(surface_m[k] - static_cast<double>(heights_m[k]));
    summary.count(error_m);
    summary.largest_m = std::max(summary.largest_m, error_m);
  }
  summary.largest_in_place_m = summary.largest_m;
  return summary;
}

}  // namespace qmpipe
