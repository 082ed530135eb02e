#include "stages/finish/normals.h"

#include <algorithm>
#include <array>

#include "formats/tile/oct_normal.h"
#include "scheduler/check.h"
#include "stages/surface/geodesy.h"

namespace qmpipe {
namespace {

// Sines and cosines of a tile's columns and rows with their halo, computed once instead of for each
// neighbour of each vertex. Columns are wrapped first, so that the tiles on both sides of the
// antimeridian compute with the same doubles.
class PostFrame {
 public:
  PostFrame(const Lattice& lattice, const PostWindow& window) : window_(window) {
    for (std::int32_t k = 0; k < window.width_posts; ++k) {
      const double lon_deg = lattice.longitude_deg(lattice.wrap_column(window.i0 + k));
      columns_.push_back(up_at(lon_deg, 0));
    }
    for (std::int32_t k = 0; k < window.height_posts; ++k) {
      const std::int64_t j = window.j0 + k;
      rows_.push_back(lattice.has_row(j) ? meridian_row(lattice.latitude_deg(j)) : Row{});
    }
  }

  Vec3 position(std::int64_t i, std::int64_t j, double height_m) const {
    const Row& row = rows_[static_cast<std::size_t>(j - window_.j0)];
    const Vec3& column = columns_[static_cast<std::size_t>(i - window_.i0)];
    const double radius = row.radius_m + height_m * row.up_radius;
    return {radius * column[0], radius * column[1], row.z_m + height_m * row.up_z};
  }

 private:
  struct Row {
    double radius_m = 0;  // distance of the ellipsoid's point from the axis
    double z_m = 0;
    double up_radius = 0;  // components of the unit vector up
    double up_z = 0;
  };
  static Row meridian_row(double latitude_deg) {
    const Vec3 foot = to_ecef({.longitude_deg = 0, .latitude_deg = latitude_deg, .height_m = 0});
    const Vec3 up = up_at(0, latitude_deg);
    return {.radius_m = foot[0], .z_m = foot[2], .up_radius = up[0], .up_z = up[2]};
  }

  PostWindow window_;
  std::vector<Vec3> columns_;
  std::vector<Row> rows_;
};

Vec3 normal_at(const Lattice& lattice, const WindowHeights& heights, const PostFrame& frame,
               const LatticePost& post) {
  if (lattice.is_pole_row(post.j)) return {0, 0, post.j == 0 ? -1.0 : 1.0};
  const auto at = [&](std::int64_t i, std::int64_t j) {
    return frame.position(i, j, static_cast<double>(heights.height_m(i, j)));
  };
  const std::int64_t south = lattice.has_row(post.j - 1) ? post.j - 1 : post.j;
  const std::int64_t north = lattice.has_row(post.j + 1) ? post.j + 1 : post.j;
  return unit(cross(minus(at(post.i + 1, post.j), at(post.i - 1, post.j)),
                    minus(at(post.i, north), at(post.i, south))));
}

// Between which two columns or rows a place lies, and how far on the way.
struct NormalCell {
  std::int32_t first = 0;
  double part = 0;
};

NormalCell cell_of(const std::vector<double>& places, std::int32_t at) {
  const auto above = std::upper_bound(places.begin() + 1, places.end() - 1, at);
  const double low = *(above - 1);
  return {.first = static_cast<std::int32_t>(above - places.begin()) - 1,
          .part = std::clamp((at - low) / (*above - low), 0.0, 1.0)};
}

}  // namespace

Vec3 lattice_normal(const Lattice& lattice, const WindowHeights& heights, const LatticePost& post) {
  return normal_at(lattice, heights, PostFrame(lattice, heights.window), post);
}

std::vector<OctNormal> tile_normals(const TilingScheme& scheme, const TileKey& key,
                                    const PostGrid& grid, const WindowHeights& heights,
                                    std::span<const TinVertex> vertices) {
  QMPIPE_CHECK(heights.window == Lattice::tile_window(key, 1));
  const Lattice lattice(scheme, key.zoom);
  const PostFrame frame(lattice, heights.window);
  const auto normal_of = [&](std::int32_t i, std::int32_t j) {
    return normal_at(lattice, heights, frame,
                     {.i = first_post(key.x) + i, .j = first_post(key.y) + j});
  };
  std::vector<OctNormal> normals;
  normals.reserve(vertices.size());
  for (const TinVertex& vertex : vertices) {
    if (vertex.post != kNoPost) {
      normals.push_back(
          encode_oct_normal(normal_of(grid.column(vertex.post), grid.row(vertex.post))));
      continue;
    }
    const NormalCell east = cell_of(grid.u_exact, vertex.u);
    const NormalCell north = cell_of(grid.v_exact, vertex.v);
    const auto row = [&](std::int32_t j) {
      return plus(scaled(normal_of(east.first, j), 1 - east.part),
                  scaled(normal_of(east.first + 1, j), east.part));
    };
    normals.push_back(encode_oct_normal(unit(
        plus(scaled(row(north.first), 1 - north.part), scaled(row(north.first + 1), north.part)))));
  }
  return normals;
}

}  // namespace qmpipe
