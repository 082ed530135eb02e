#include "pipeline/verify/outside.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "formats/crs/wgs84.h"
#include "scheduler/elementary.h"
#include "scheduler/lattice.h"
#include "stages/finish/tile_error.h"

namespace qmpipe::verify {
namespace {

// Rounding of the posts' heights to float32.
constexpr double kRoundingM = 0.01;

struct Pair {
  std::int32_t a = -1;
  std::int32_t b = -1;
  double rise_m = 0;
  double distance_m = 0;
};

// Metres between two neighbouring posts on the ground.
double distance_m(const PostGrid& grid, std::int32_t a, std::int32_t b) {
  const auto at = [](std::int32_t k) { return static_cast<std::size_t>(k); };
  constexpr double kDegree = std::numbers::pi / 180;
  const double latitude_deg = grid.latitude_deg[at(grid.row(a))];
  const double north_m =
      (grid.latitude_deg[at(grid.row(b))] - latitude_deg) * kDegree * kEquatorialRadiusM;
  const double east_m =
      (grid.longitude_deg[at(grid.column(b))] - grid.longitude_deg[at(grid.column(a))]) * kDegree *
      kEquatorialRadiusM * cos_deg(latitude_deg);
  return std::sqrt(north_m * north_m + east_m * east_m);
}

std::string place_text(const PostGrid& grid, std::int32_t post) {
  return fmt::format("longitude {:.6f}, latitude {:.6f}",
                     grid.longitude_deg[static_cast<std::size_t>(grid.column(post))],
                     grid.latitude_deg[static_cast<std::size_t>(grid.row(post))]);
}

}  // namespace

std::vector<Finding> find_cliff(const TilingScheme& scheme, const TileOutside& tile,
                                double relief_near_m) {
  const PostGrid grid = make_tile_grid(scheme, tile.key);
  const Lattice lattice(scheme, tile.key.zoom);
  const std::vector<double> surface_m = surface_at_posts(grid, tile.mesh);
  const double allowed_m = 2 * tile.tolerance_m + kRoundingM;
  Pair worst;
  const auto look = [&](std::int32_t a, std::int32_t b) {
    const auto i = static_cast<std::size_t>(a);
    const auto k = static_cast<std::size_t>(b);
    if (tile.valid[i] != 0 && tile.valid[k] != 0) return;
    const double rise_m = std::abs(surface_m[i] - surface_m[k]) - allowed_m;
    // Also false where there is no surface.
    if (!(rise_m > relief_near_m && rise_m > worst.rise_m)) return;
    const double apart_m = distance_m(grid, a, b);
    if (rise_m > apart_m) worst = {.a = a, .b = b, .rise_m = rise_m, .distance_m = apart_m};
  };
  const std::int64_t j0 = Lattice::tile_window(tile.key, 0).j0;
  for (std::int32_t j = 0; j < grid.height_posts; ++j) {
    // A pole row is one point of the globe: its posts have no distance.
    if (lattice.is_pole_row(j0 + j)) continue;
    for (std::int32_t i = 0; i < grid.width_posts; ++i) {
      if (i + 1 < grid.width_posts) look(grid.index(i, j), grid.index(i + 1, j));
      if (j + 1 < grid.height_posts) look(grid.index(i, j), grid.index(i, j + 1));
    }
  }
  if (worst.a < 0) return {};
  return {{.kind = FindingKind::kCliffOutside,
           .key = tile.key,
           .text = fmt::format("outside the data, at {}, the surface rises by {:.1f} m over {:.1f} "
                               "m, more than the {:.1f} m between the heights of the data near by",
                               place_text(grid, worst.a), worst.rise_m + allowed_m,
                               worst.distance_m, relief_near_m)}};
}

std::vector<Finding> find_levels_apart(const TilingScheme& scheme, const TileOutside& tile,
                                       const TileOutside& parent) {
  const PostGrid grid = make_tile_grid(scheme, tile.key);
  const PostGrid parent_grid = make_tile_grid(scheme, parent.key);
  const std::vector<double> surface_m = surface_at_posts(grid, tile.mesh);
  const std::vector<double> parent_m = surface_at_posts(parent_grid, parent.mesh);
  const std::int32_t i0 = tile.key.x % 2 * (kTileIntervals / 2);
  const std::int32_t j0 = tile.key.y % 2 * (kTileIntervals / 2);
  double largest_m = tile.tolerance_m + parent.tolerance_m + kRoundingM;
  std::int32_t worst = -1;
  for (std::int32_t j = 0; j < grid.height_posts; j += 2) {
    for (std::int32_t i = 0; i < grid.width_posts; i += 2) {
      const std::int32_t post = grid.index(i, j);
      if (tile.valid[static_cast<std::size_t>(post)] != 0) continue;
      const double here_m = surface_m[static_cast<std::size_t>(post)];
      const double there_m =
          parent_m[static_cast<std::size_t>(parent_grid.index(i0 + i / 2, j0 + j / 2))];
      if (std::abs(here_m - there_m) > largest_m) {
        largest_m = std::abs(here_m - there_m);
        worst = post;
      }
    }
  }
  if (worst < 0) return {};
  return {{.kind = FindingKind::kLevelsApartOutside,
           .key = tile.key,
           .text = fmt::format("outside the data, at {}, the surface is {:.1f} m from that of the "
                               "parent tile, more than the tolerances of {:g} m and {:g} m",
                               place_text(grid, worst), largest_m, tile.tolerance_m,
                               parent.tolerance_m)}};
}

}  // namespace qmpipe::verify
