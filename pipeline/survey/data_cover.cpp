#include "pipeline/survey/data_cover.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <nlohmann/json.hpp>
#include <set>
#include <span>
#include <utility>

namespace qmpipe {
namespace {

constexpr std::int32_t kMostPosts = 160;
// Data of so many posts lie in no more tiles, and tiles share the posts of their sides.
constexpr std::size_t kMostTiles = 9;

// What is on one parallel ends where it began: the columns after the widest gap, up to it.
PostWindow around(const std::set<std::int64_t>& columns, const std::set<std::int64_t>& rows,
                  std::int64_t columns_of_globe) {
  std::int64_t first = *columns.begin();
  std::int64_t widest = first + columns_of_globe - *columns.rbegin();
  for (auto next = std::next(columns.begin()); next != columns.end(); ++next) {
    const std::int64_t gap = *next - *std::prev(next);
    if (gap > widest) {
      widest = gap;
      first = *next;
    }
  }
  return {.i0 = first,
          .j0 = *rows.begin(),
          .width_posts = static_cast<std::int32_t>(columns_of_globe - widest + 1),
          .height_posts = static_cast<std::int32_t>(*rows.rbegin() - *rows.begin() + 1)};
}

std::vector<float> heights_in(const LatticeStore& store, const Lattice& lattice,
                              const PostWindow& window) {
  std::vector<float> heights_m(window.size());
  store.read(lattice, window, heights_m);
  return heights_m;
}

// The smallest window with all valid posts of a zoom.
std::optional<PostWindow> window_of_data(const Survey& survey, const Lattice& lattice) {
  std::set<std::int64_t> columns;
  std::set<std::int64_t> rows;
  for (const SurveyedTile& tile : survey.tiles[static_cast<std::size_t>(lattice.zoom())]) {
    const PostWindow window = Lattice::tile_window(tile.key, 0);
    const std::vector<float> heights_m = heights_in(*survey.store, lattice, window);
    std::array<bool, kTilePosts> has_column{};
    const auto width = static_cast<std::size_t>(window.width_posts);
    for (std::int32_t j = 0; j < window.height_posts; ++j) {
      if (lattice.is_pole_row(window.j0 + j)) continue;
      bool has_row = false;
      for (std::size_t i = 0; i < width; ++i) {
        if (std::isnan(heights_m[static_cast<std::size_t>(j) * width + i])) continue;
        has_row = true;
        has_column.at(i) = true;
      }
      if (has_row) rows.insert(window.j0 + j);
    }
    for (std::int32_t i = 0; i < window.width_posts; ++i) {
      if (has_column.at(static_cast<std::size_t>(i))) {
        columns.insert(lattice.wrap_column(window.i0 + i));
      }
    }
  }
  if (rows.empty()) return std::nullopt;
  const PoleHeights& poles = survey.pole_heights[static_cast<std::size_t>(lattice.zoom())];
  if (poles[0] && *rows.begin() == 1) rows.insert(0);
  if (poles[1] && *rows.rbegin() == lattice.rows() - 2) rows.insert(lattice.rows() - 1);
  return around(columns, rows, lattice.columns());
}

std::vector<std::int32_t> turns_of(std::span<const float> row_m) {
  std::vector<std::int32_t> turns;
  auto from = row_m.begin();
  for (bool is_void = true; from != row_m.end(); is_void = !is_void) {
    const auto to = std::find_if(from, row_m.end(),
                                 [&](float height_m) { return std::isnan(height_m) != is_void; });
    if (to == row_m.end() && is_void) break;
    turns.push_back(static_cast<std::int32_t>(to - from));
    from = to;
  }
  return turns;
}

DataCover cover_of(const LatticeStore& store, const Lattice& lattice, const PostWindow& window) {
  const std::vector<float> heights_m = heights_in(store, lattice, window);
  DataCover cover;
  cover.posts_deg = {.west_deg = lattice.longitude_deg(window.i0),
                     .south_deg = lattice.latitude_deg(window.j0),
                     .east_deg = lattice.longitude_deg(window.i0 + window.width_posts - 1),
                     .north_deg = lattice.latitude_deg(window.j0 + window.height_posts - 1)};
  cover.columns = window.width_posts;
  const auto width = static_cast<std::size_t>(window.width_posts);
  for (std::int32_t row = 0; row < window.height_posts; ++row) {
    // A pole is one place, and in the window only where it has a height.
    const bool is_pole = lattice.is_pole_row(window.j0 + row);
    const std::size_t at = static_cast<std::size_t>(row) * width;
    cover.rows.push_back(is_pole ? std::vector<std::int32_t>{0, window.width_posts}
                                 : turns_of(std::span(heights_m).subspan(at, width)));
  }
  return cover;
}

}  // namespace

std::optional<DataCover> data_cover(const Survey& survey) {
  std::optional<Lattice> lattice;
  PostWindow window;
  for (std::int32_t zoom = 0; zoom <= survey.max_zoom; ++zoom) {
    if (zoom > 0 && survey.tiles[static_cast<std::size_t>(zoom)].size() > kMostTiles) break;
    const Lattice here(survey.scheme, zoom);
    const std::optional<PostWindow> around_data = window_of_data(survey, here);
    if (!around_data) continue;
    if (lattice && std::max(around_data->width_posts, around_data->height_posts) > kMostPosts)
      break;
    lattice = here;
    window = *around_data;
  }
  if (!lattice) return std::nullopt;
  return cover_of(*survey.store, *lattice, window);
}

std::string with_cover(const std::string& recipe_json, const DataCover& cover) {
  nlohmann::ordered_json object = nlohmann::ordered_json::parse(recipe_json);
  const RectangleDeg& box = cover.posts_deg;
  std::vector<std::string> rows;
  for (auto from = cover.rows.begin(); from != cover.rows.end();) {
    const auto to =
        std::find_if(from, cover.rows.end(), [from](const auto& turns) { return turns != *from; });
    rows.push_back(fmt::format("{}: {}", to - from, fmt::join(*from, " ")));
    from = to;
  }
  object["data"] = {
      {"posts_deg", std::array{box.west_deg, box.south_deg, box.east_deg, box.north_deg}},
      {"columns", cover.columns},
      {"rows", std::move(rows)}};
  return object.dump();
}

}  // namespace qmpipe
