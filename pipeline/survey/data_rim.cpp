#include "pipeline/survey/data_rim.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "formats/crs/wgs84.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr double kSpacingsPerRim = 4;
// Meridians meet at the poles, distances along parallels do not matter any more.
constexpr double kLeastCosine = 0.1;

// The distance of two posts on a parallel, which is the smaller one of a geodetic grid's.
double post_spacing_m(const TilingScheme& scheme, const TileKey& key) {
  const RectangleDeg rectangle = scheme.rectangle_deg(key);
  const double latitude_deg = (rectangle.south_deg + rectangle.north_deg) / 2;
  return (rectangle.east_deg - rectangle.west_deg) / kTileIntervals * (std::numbers::pi / 180) *
         kEquatorialRadiusM * std::max(kLeastCosine, cos_deg(latitude_deg));
}

bool is_gentle(const Survey& survey, const VoidPolicy& policy, std::int32_t zoom) {
  const auto& tiles = survey.tiles[static_cast<std::size_t>(zoom)];
  return std::all_of(tiles.begin(), tiles.end(), [&](const SurveyedTile& tile) {
    const double spacing_m = post_spacing_m(survey.scheme, tile.key);
    if (policy.fade_m > 0) return spacing_m >= policy.fade_m;
    return spacing_m >= kSpacingsPerRim * static_cast<double>(tile.rim_m);
  });
}

}  // namespace

float rim_of(const Lattice& lattice, const PostWindow& window, std::span<const float> heights_m) {
  float rim_m = 0;
  const auto at = [&](std::int32_t i, std::int32_t j) {
    return heights_m[static_cast<std::size_t>(j) * static_cast<std::size_t>(window.width_posts) +
                     static_cast<std::size_t>(i)];
  };
  const auto look = [&](float here, float beside) {
    if (std::isnan(here) != std::isnan(beside)) {
      rim_m = std::max(rim_m, std::abs(std::isnan(here) ? beside : here));
    }
  };
  for (std::int32_t j = 0; j < window.height_posts; ++j) {
    if (lattice.is_pole_row(window.j0 + j)) continue;
    const bool has_next_row =
        j + 1 < window.height_posts && !lattice.is_pole_row(window.j0 + j + 1);
    for (std::int32_t i = 0; i < window.width_posts; ++i) {
      if (i + 1 < window.width_posts) look(at(i, j), at(i + 1, j));
      if (has_next_row) look(at(i, j), at(i, j + 1));
    }
  }
  return rim_m;
}

VoidPolicy settled_policy(VoidPolicy policy, const Survey& survey) {
  policy.base_zoom = 0;
  while (policy.base_zoom < survey.max_zoom && is_gentle(survey, policy, policy.base_zoom + 1)) {
    ++policy.base_zoom;
  }
  return policy;
}

}  // namespace qmpipe
