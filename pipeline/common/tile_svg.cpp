#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>

#include "pipeline/common/svg.h"
#include "scheduler/check.h"
#include "stages/surface/geodesy.h"
#include "stages/surface/metric_frame.h"

namespace qmpipe {
namespace {

constexpr double kPixels = 512;
constexpr int kGreys = 40;
// Relief this high against the tile's width looks right from above.
constexpr double kReliefShare = 0.12;
// One quad of the posts' picture covers so many intervals.
constexpr std::int32_t kQuadIntervals = 2;

// Grey levels of slopes, and the shapes that have each.
class Shading {
 public:
  Shading(const PostGrid& grid, double range_m)
      : metres_per_u_(std::max(flat_scale(grid).metres_per_u, 1e-9)),
        exaggeration_(range_m > 0 ? kReliefShare * metres_per_u_ * grid.u_max() / range_m : 1),
        pixels_per_u_(kPixels / std::max(grid.u_max(), grid.v_max())),
        height_px_(grid.v_max() * pixels_per_u_) {}

  int x(double u) const { return static_cast<int>(std::lround(u * pixels_per_u_)); }
  // Pixels count from the north.
  int y(double v) const { return static_cast<int>(std::lround(height_px_ - v * pixels_per_u_)); }

  // The slopes in metres for a unit of u and of v.
  int grey(double du_m, double dv_m) const {
    const double scale = exaggeration_ / metres_per_u_;
    const Vec3 normal = unit({-du_m * scale, -dv_m * scale, 1});
    // From the north-west, 45 degrees high.
    const double light = dot(normal, {-0.5, 0.5, std::numbers::sqrt2 / 2});
    return static_cast<int>(std::lround(std::clamp(light, 0.0, 1.0) * (kGreys - 1)));
  }

  void add(int grey_level, const std::string& path) { paths_[grey_level] += path; }

  std::string svg(const char* stroke) const {
    std::string text =
        fmt::format("<svg class=\"tile\" viewBox=\"0 0 {0} {1}\" width=\"{0}\" height=\"{1}\">",
                    kPixels, std::lround(height_px_));
    for (const auto& [grey_level, path] : paths_) {
      const int value = 25 + grey_level * 230 / (kGreys - 1);
      text +=
          fmt::format("<path fill=\"#{0:02x}{0:02x}{0:02x}\" {1} d=\"{2}\"/>", value, stroke, path);
    }
    return text + "</svg>\n";
  }

 private:
  double metres_per_u_;
  double exaggeration_;
  double pixels_per_u_;
  double height_px_;
  std::map<int, std::string> paths_;
};

}  // namespace

std::string tin_svg(const PostGrid& grid, const Tin& tin) {
  QMPIPE_CHECK(!tin.vertices.empty());
  const auto [low, high] = std::minmax_element(
      tin.vertices.begin(), tin.vertices.end(),
      [](const TinVertex& a, const TinVertex& b) { return a.height_m < b.height_m; });
  Shading shading(grid, high->height_m - low->height_m);
  for (std::size_t t = 0; t < tin.indices.size(); t += 3) {
    const TinVertex& a = tin.vertices[tin.indices[t]];
    const TinVertex& b = tin.vertices[tin.indices[t + 1]];
    const TinVertex& c = tin.vertices[tin.indices[t + 2]];
    const double area =
        static_cast<double>(b.u - a.u) * (c.v - a.v) - static_cast<double>(b.v - a.v) * (c.u - a.u);
    const double ab_m = b.height_m - a.height_m;
    const double ac_m = c.height_m - a.height_m;
    const int grey = shading.grey((ab_m * (c.v - a.v) - ac_m * (b.v - a.v)) / area,
                                  (ac_m * (b.u - a.u) - ab_m * (c.u - a.u)) / area);
    const int x = shading.x(a.u);
    const int y = shading.y(a.v);
    shading.add(grey, fmt::format("M{} {}l{} {}L{} {}z", x, y, shading.x(b.u) - x,
                                  shading.y(b.v) - y, shading.x(c.u), shading.y(c.v)));
  }
  return shading.svg("stroke=\"#00408090\" stroke-width=\".5\"");
}

std::string posts_svg(const PostGrid& grid, std::span<const float> heights_m) {
  QMPIPE_CHECK(heights_m.size() == grid.post_count());
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  Shading shading(grid, static_cast<double>(*high) - static_cast<double>(*low));
  const auto height = [&](std::int32_t i, std::int32_t j) {
    return static_cast<double>(heights_m[static_cast<std::size_t>(grid.index(i, j))]);
  };
  for (std::int32_t j = 0; j + 1 < grid.height_posts; j += kQuadIntervals) {
    const std::int32_t north = std::min(j + kQuadIntervals, grid.height_posts - 1);
    for (std::int32_t i = 0; i + 1 < grid.width_posts; i += kQuadIntervals) {
      const std::int32_t east = std::min(i + kQuadIntervals, grid.width_posts - 1);
      const double u0 = grid.u_exact[static_cast<std::size_t>(i)];
      const double u1 = grid.u_exact[static_cast<std::size_t>(east)];
      const double v0 = grid.v_exact[static_cast<std::size_t>(j)];
      const double v1 = grid.v_exact[static_cast<std::size_t>(north)];
      const double du_m =
          (height(east, j) + height(east, north) - height(i, j) - height(i, north)) /
          (2 * (u1 - u0));
      const double dv_m =
          (height(i, north) + height(east, north) - height(i, j) - height(east, j)) /
          (2 * (v1 - v0));
      shading.add(shading.grey(du_m, dv_m),
                  fmt::format("M{} {}H{}V{}H{}z", shading.x(u0), shading.y(v0), shading.x(u1),
                              shading.y(v1), shading.x(u0)));
    }
  }
  return shading.svg("shape-rendering=\"crispEdges\"");
}

}  // namespace qmpipe
