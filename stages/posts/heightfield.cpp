#include "stages/posts/heightfield.h"

#include <algorithm>
#include <cmath>

namespace qmpipe {
namespace {

// Rounds down for negative columns too, which a halo west of column 0 has.
constexpr std::int64_t half_down(std::int64_t k) { return k >> 1; }
constexpr std::int64_t half_up(std::int64_t k) { return (k + 1) >> 1; }

// The posts of the coarser zoom between which the window's posts lie.
PostWindow coarser_window(const PostWindow& window) {
  const std::int64_t i0 = half_down(window.i0);
  const std::int64_t j0 = half_down(window.j0);
  return {.i0 = i0,
          .j0 = j0,
          .width_posts =
              static_cast<std::int32_t>(half_up(window.i0 + window.width_posts - 1) - i0 + 1),
          .height_posts =
              static_cast<std::int32_t>(half_up(window.j0 + window.height_posts - 1) - j0 + 1)};
}

std::size_t position(const PostWindow& window, std::int64_t i, std::int64_t j) {
  return static_cast<std::size_t>(j - window.j0) * static_cast<std::size_t>(window.width_posts) +
         static_cast<std::size_t>(i - window.i0);
}

bool any_void(const std::vector<float>& heights_m) {
  return std::any_of(heights_m.begin(), heights_m.end(), [](float h) { return std::isnan(h); });
}

}  // namespace

Heightfield::Heightfield(const LatticeStore& store, TilingScheme scheme, VoidPolicy policy,
                         std::vector<PoleHeights> pole_heights)
    : store_(store), scheme_(scheme), policy_(policy), pole_heights_(std::move(pole_heights)) {}

WindowHeights Heightfield::window(std::int32_t zoom, const PostWindow& window) const {
  const Lattice lattice(scheme_, zoom);
  WindowHeights result;
  result.window = window;
  result.heights_m.resize(window.size());
  result.valid.resize(window.size());
  store_.read(lattice, window, result.heights_m);
  for (std::size_t k = 0; k < result.valid.size(); ++k) {
    result.valid[k] = std::isnan(result.heights_m[k]) ? 0 : 1;
  }
  fill(lattice, window, result.heights_m);
  return result;
}

std::int32_t Heightfield::coarsest_for(std::int32_t zoom) const {
  return policy_.kind == VoidPolicy::Kind::kHeight ? zoom : std::min(policy_.base_zoom, zoom);
}

void Heightfield::fill(const Lattice& lattice, const PostWindow& window,
                       std::vector<float>& heights_m) const {
  // First: a window without voids shows the same pole as one with them.
  fill_pole_rows(lattice, window, heights_m);
  if (!any_void(heights_m)) return;
  const auto base_m = static_cast<float>(policy_.base_height_m);
  if (lattice.zoom() == coarsest_for(lattice.zoom())) {
    std::replace_if(
        heights_m.begin(), heights_m.end(), [](float h) { return std::isnan(h); }, base_m);
    return;
  }
  const Lattice coarser(scheme_, lattice.zoom() - 1);
  const PostWindow around = coarser_window(window);
  std::vector<float> pulled_m(around.size());
  store_.read(coarser, around, pulled_m);
  fill(coarser, around, pulled_m);
  for (std::int64_t j = window.j0; j < window.j0 + window.height_posts; ++j) {
    for (std::int64_t i = window.i0; i < window.i0 + window.width_posts; ++i) {
      float& height_m = heights_m[position(window, i, j)];
      if (!std::isnan(height_m)) continue;
      const float south_west = pulled_m[position(around, half_down(i), half_down(j))];
      const float south_east = pulled_m[position(around, half_up(i), half_down(j))];
      const float north_west = pulled_m[position(around, half_down(i), half_up(j))];
      const float north_east = pulled_m[position(around, half_up(i), half_up(j))];
      height_m = ((south_west + south_east) + (north_west + north_east)) * 0.25F;
    }
  }
}

float Heightfield::pole_height_m(std::int32_t zoom, std::size_t pole) const {
  for (std::int32_t from = zoom; from >= coarsest_for(zoom); --from) {
    const auto& height_m = pole_heights_.at(static_cast<std::size_t>(from))[pole];
    if (height_m) return *height_m;
  }
  return static_cast<float>(policy_.base_height_m);
}

// The whole row takes one height, data or none: it is one point of the globe.
void Heightfield::fill_pole_rows(const Lattice& lattice, const PostWindow& window,
                                 std::vector<float>& heights_m) const {
  for (const std::int64_t j : {std::int64_t{0}, lattice.rows() - 1}) {
    if (!lattice.is_pole_row(j) || j < window.j0 || j >= window.j0 + window.height_posts) continue;
    const auto row =
        heights_m.begin() + static_cast<std::ptrdiff_t>(position(window, window.i0, j));
    std::fill(row, row + window.width_posts, pole_height_m(lattice.zoom(), j == 0 ? 0 : 1));
  }
}

}  // namespace qmpipe
