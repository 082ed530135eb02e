#include "pipeline/verify/pixels.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <set>

#include "formats/sources/source_pool.h"
#include "scheduler/lattice.h"

namespace qmpipe::verify {
namespace {

constexpr double kPixelsInAll = 4096;
constexpr std::int64_t kFewestPerSide = 3;
constexpr std::int64_t kMostPerSide = 33;
// Zooms that may lie between the sampled posts and the deepest tiles: what a post there must be surely
// made of is asked for around a pixel.
constexpr std::int32_t kMostZoomsBetween = 5;

class PixelCheck {
 public:
  PixelCheck(const std::vector<RasterInfo>& sources, const HeightOptions& heights,
             const Recipe& recipe)
      : recipe_(recipe),
        scheme_(recipe.projection),
        reach_(
            std::int64_t{1} << std::min(kMostZoomsBetween, recipe.sampling_zoom - recipe.max_zoom)),
        pool_(std::make_shared<const std::vector<RasterInfo>>(sources), {.heights = heights}, 1) {}

  // Of the source's pixel, where it stands among valid ones and the scheme has a tile.
  std::optional<TileKey> tile_at(std::size_t source, std::int64_t column, std::int64_t row);
  std::int64_t reach() const { return reach_; }

 private:
  bool is_among_valid(std::size_t source, std::int64_t column, std::int64_t row);

  const Recipe& recipe_;
  TilingScheme scheme_;
  std::int64_t reach_;  // pixels around one
  SourcePool pool_;
  std::vector<double> heights_m_;
};

bool PixelCheck::is_among_valid(std::size_t source, std::int64_t column, std::int64_t row) {
  const PixelWindow window{.column0 = column - reach_,
                           .row0 = row - reach_,
                           .width = 2 * reach_ + 1,
                           .height = 2 * reach_ + 1};
  heights_m_.resize(window.size());
  pool_.source(source).read(window, heights_m_);
  return std::none_of(heights_m_.begin(), heights_m_.end(), [](double h) { return std::isnan(h); });
}

std::optional<TileKey> PixelCheck::tile_at(std::size_t source, std::int64_t column,
                                           std::int64_t row) {
  const RasterInfo& info = pool_.info(source);
  const std::optional<LonLat> at =
      pool_.grid(source).globe_at({.column = static_cast<double>(column + info.part.column) + 0.5,
                                   .row = static_cast<double>(row + info.part.row) + 0.5});
  const double limit_deg = scheme_.rectangle_deg({.zoom = 0, .x = 0, .y = 0}).north_deg;
  if (!at || !(std::abs(at->latitude_deg) < limit_deg)) return std::nullopt;
  if (!is_among_valid(source, column, row)) return std::nullopt;
  const Lattice lattice(scheme_, recipe_.max_zoom);
  const auto tile = [](double post) {
    return static_cast<std::int64_t>(std::floor(post / kTileIntervals));
  };
  const std::int32_t columns = scheme_.columns(recipe_.max_zoom);
  const std::int64_t x = tile(lattice.column_at(at->longitude_deg)) % columns;
  return TileKey{.zoom = recipe_.max_zoom,
                 .x = static_cast<std::int32_t>((x + columns) % columns),
                 .y = static_cast<std::int32_t>(tile(lattice.row_at(at->latitude_deg)))};
}

// From the first that has so many pixels around it to the last.
std::vector<std::int64_t> spread_between(std::int64_t length, std::int64_t reach,
                                         std::int64_t count) {
  std::vector<std::int64_t> indices;
  const std::int64_t room = length - 1 - 2 * reach;
  for (std::int64_t k = 0; k < count && room >= 0; ++k) {
    const std::int64_t index = reach + room * k / (count - 1);
    if (indices.empty() || indices.back() != index) indices.push_back(index);
  }
  return indices;
}

}  // namespace

std::vector<Finding> check_pixels(const std::vector<RasterInfo>& sources,
                                  const HeightOptions& heights, const Recipe& recipe,
                                  const std::vector<TileKey>& keys,
                                  const std::vector<TileKey>& expected) {
  std::vector<Finding> findings;
  if (recipe.sampling_zoom - recipe.max_zoom > kMostZoomsBetween) return findings;
  const auto per_side = std::clamp(
      static_cast<std::int64_t>(std::sqrt(kPixelsInAll / static_cast<double>(sources.size()))),
      kFewestPerSide, kMostPerSide);
  PixelCheck check(sources, heights, recipe);
  std::set<TileKey> missing;
  for (std::size_t k = 0; k < sources.size(); ++k) {
    for (const std::int64_t row : spread_between(sources[k].height, check.reach(), per_side)) {
      for (const std::int64_t column : spread_between(sources[k].width, check.reach(), per_side)) {
        const std::optional<TileKey> key = check.tile_at(k, column, row);
        if (!key || std::binary_search(keys.begin(), keys.end(), *key) ||
            std::binary_search(expected.begin(), expected.end(), *key) ||
            !missing.insert(*key).second) {
          continue;
        }
        findings.push_back(
            {.kind = FindingKind::kMissingTile,
             .key = *key,
             .text = fmt::format("{} has heights here (column {}, row {}), but the set has no tile",
                                 sources[k].path, column, row)});
      }
    }
  }
  return findings;
}

}  // namespace qmpipe::verify
