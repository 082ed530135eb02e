#include "pipeline/web_check/check_available.h"

#include <fmt/format.h>

#include <algorithm>

namespace qmpipe::web_check {
namespace {

std::string range_text(const TileRange& range) {
  return fmt::format("columns {} to {}, rows {} to {}", range.start_x, range.end_x, range.start_y,
                     range.end_y);
}

// What of `whole` is left when `hole` is cut out: up to four rectangles.
void append_rest(const TileRange& whole, const TileRange& hole, std::vector<TileRange>& rest) {
  const bool is_apart = hole.end_x < whole.start_x || hole.start_x > whole.end_x ||
                        hole.end_y < whole.start_y || hole.start_y > whole.end_y;
  if (is_apart) {
    rest.push_back(whole);
    return;
  }
  TileRange left = whole;
  if (hole.start_y > whole.start_y) {
    rest.push_back({left.start_x, left.start_y, left.end_x, hole.start_y - 1});
    left.start_y = hole.start_y;
  }
  if (hole.end_y < whole.end_y) {
    rest.push_back({left.start_x, hole.end_y + 1, left.end_x, left.end_y});
    left.end_y = hole.end_y;
  }
  if (hole.start_x > whole.start_x) {
    rest.push_back({left.start_x, left.start_y, hole.start_x - 1, left.end_y});
  }
  if (hole.end_x < whole.end_x) {
    rest.push_back({hole.end_x + 1, left.start_y, left.end_x, left.end_y});
  }
}

class AvailableCheck {
 public:
  AvailableCheck(ServedLayer& layer, const WebAddress& url, CheckLog& log)
      : layer_(layer), url_(url), log_(log) {}

  void run() {
    take_sound_ranges();
    if (range_count_ == 0) {
      if (!log_.has(CheckKind::kAvailableRange)) {
        add(CheckKind::kAvailableEmpty, "\"available\" lists no tile");
      }
      layer_.is_usable = false;
      return;
    }
    // With a set below it, what is missing here may be there.
    if (!layer_.has_parent) {
      check_roots();
      check_parents();
    }
    check_max_zoom();
  }

 private:
  void add(CheckKind kind, const std::string& text) {
    log_.add(kind, CheckSubject::kLayer, url_.text(), text);
  }

  bool is_sound(const TileRange& range, std::int32_t zoom) const {
    return range.start_x <= range.end_x && range.start_y <= range.end_y &&
           layer_.scheme.contains({.zoom = zoom, .x = range.start_x, .y = range.start_y}) &&
           layer_.scheme.contains({.zoom = zoom, .x = range.end_x, .y = range.end_y});
  }

  void take_sound_ranges() {
    const auto& zooms = layer_.parsed.layer.available;
    for (std::size_t k = 0; k < zooms.size(); ++k) {
      const auto zoom = static_cast<std::int32_t>(k);
      if (zoom > kMaxZoom) return take_no_deeper(zooms);
      std::vector<TileRange>& sound = layer_.available.emplace_back();
      const TileRange* bad = nullptr;
      for (const TileRange& range : zooms[k]) {
        if (is_sound(range, zoom)) {
          sound.push_back(range);
        } else if (bad == nullptr) {
          bad = &range;
        }
      }
      range_count_ += sound.size();
      if (bad == nullptr) continue;
      add(CheckKind::kAvailableRange,
          fmt::format("{} of {} ranges of zoom {} are reversed or outside the tiling scheme, the "
                      "first: {}; the zoom has {} columns and {} rows",
                      zooms[k].size() - sound.size(), zooms[k].size(), zoom, range_text(*bad),
                      layer_.scheme.columns(zoom), layer_.scheme.rows(zoom)));
    }
  }

  void take_no_deeper(const std::vector<std::vector<TileRange>>& zooms) {
    const bool has_deeper = std::any_of(zooms.begin() + kMaxZoom + 1, zooms.end(),
                                        [](const auto& ranges) { return !ranges.empty(); });
    if (!has_deeper) return;
    add(CheckKind::kDeeperNotChecked,
        fmt::format("\"available\" lists tiles deeper than zoom {}", kMaxZoom));
  }

  void check_roots() {
    std::vector<std::string> missing;
    for (const TileKey& root : layer_.scheme.roots()) {
      if (!layer_.lists(root)) missing.push_back(to_string(root));
    }
    if (missing.empty()) return;
    add(CheckKind::kAvailableRoots,
        fmt::format("available[0] does not list {}", fmt::join(missing, " and ")));
  }

  // Zoom 0 is check_roots()' business.
  void check_parents() {
    if (range_count_ > kMostRangesCompared) {
      return add(CheckKind::kManyRanges, fmt::format("\"available\" has {} ranges", range_count_));
    }
    for (std::size_t zoom = 2; zoom < layer_.available.size(); ++zoom) {
      const auto hole = unlisted_parent(layer_.available[zoom], layer_.available[zoom - 1],
                                        static_cast<std::int32_t>(zoom));
      if (!hole) continue;
      add(CheckKind::kAvailableHole,
          fmt::format("tiles of zoom {} are listed whose parent {} is not", zoom,
                      to_string(*hole)));
    }
  }

  void check_max_zoom() {
    if (!layer_.parsed.has_max_zoom) return;
    const std::int32_t max_zoom = layer_.parsed.layer.max_zoom;
    std::int32_t deepest = 0;
    for (std::size_t zoom = 0; zoom < layer_.available.size(); ++zoom) {
      if (!layer_.available[zoom].empty()) deepest = static_cast<std::int32_t>(zoom);
    }
    if (max_zoom >= deepest) return;
    add(CheckKind::kMaxZoomLow, fmt::format("\"maxzoom\" is {}, \"available\" lists tiles down to "
                                            "zoom {}",
                                            max_zoom, deepest));
  }

  ServedLayer& layer_;
  const WebAddress& url_;
  CheckLog& log_;
  std::size_t range_count_ = 0;
};

}  // namespace

std::optional<TileKey> unlisted_parent(const std::vector<TileRange>& children,
                                       const std::vector<TileRange>& parents,
                                       std::int32_t child_zoom) {
  for (const TileRange& range : children) {
    std::vector<TileRange> uncovered = {
        {range.start_x / 2, range.start_y / 2, range.end_x / 2, range.end_y / 2}};
    for (const TileRange& parent : parents) {
      std::vector<TileRange> rest;
      for (const TileRange& part : uncovered) append_rest(part, parent, rest);
      uncovered = std::move(rest);
      if (uncovered.empty()) break;
    }
    if (!uncovered.empty()) {
      return TileKey{
          .zoom = child_zoom - 1, .x = uncovered.front().start_x, .y = uncovered.front().start_y};
    }
  }
  return std::nullopt;
}

void check_available(ServedLayer& layer, AvailableKey key, const WebAddress& url, CheckLog& log) {
  if (key == AvailableKey::kAbsent) {
    log.add(CheckKind::kNoAvailability, CheckSubject::kLayer, url.text(),
            "there is neither \"available\" nor \"metadataAvailability\"");
    layer.is_usable = false;
    return;
  }
  AvailableCheck(layer, url, log).run();
}

}  // namespace qmpipe::web_check
