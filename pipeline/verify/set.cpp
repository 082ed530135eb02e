#include "pipeline/verify/set.h"

#include <fmt/format.h>

#include <algorithm>
#include <span>
#include <string_view>

namespace qmpipe::verify {
namespace {

constexpr std::size_t kExamples = 3;

// A number of tiles and the first few of them.
struct KeyList {
  std::int64_t count = 0;
  std::vector<TileKey> first;

  void add(const TileKey& key) {
    ++count;
    if (first.size() < kExamples) first.push_back(key);
  }
  std::string text() const {
    std::vector<std::string> names;
    for (const TileKey& key : first) names.push_back(to_string(key));
    const bool has_more = count > static_cast<std::int64_t>(first.size());
    return fmt::format("{}{}", fmt::join(names, ", "), has_more ? ", ..." : "");
  }
};

std::string tiles_text(std::int64_t count) {
  return count == 1 ? "1 tile" : fmt::format("{} tiles", count);
}

Finding finding_of(FindingKind kind, std::string text) {
  return {.kind = kind, .key = std::nullopt, .text = std::move(text)};
}

struct Interval {
  std::int32_t first = 0;
  std::int32_t last = 0;
};

// Rows y0..y1 in which the same columns are listed.
struct Slab {
  std::int32_t y0 = 0;
  std::int32_t y1 = 0;
  std::vector<Interval> columns;  // ascending, disjoint

  std::int64_t columns_in_a_row() const {
    std::int64_t sum = 0;
    for (const Interval& interval : columns)
      sum += std::int64_t{interval.last} - interval.first + 1;
    return sum;
  }
  bool lists_column(std::int32_t x) const {
    const auto after = std::upper_bound(
        columns.begin(), columns.end(), x,
        [](std::int32_t value, const Interval& interval) { return value < interval.first; });
    return after != columns.begin() && x <= std::prev(after)->last;
  }
};

std::vector<Interval> merged_columns(const std::vector<TileRange>& ranges) {
  std::vector<Interval> columns;
  for (const TileRange& range : ranges) {
    columns.push_back({.first = range.start_x, .last = range.end_x});
  }
  std::sort(columns.begin(), columns.end(),
            [](const Interval& a, const Interval& b) { return a.first < b.first; });
  std::vector<Interval> merged;
  for (const Interval& interval : columns) {
    if (!merged.empty() && interval.first <= merged.back().last + 1) {
      merged.back().last = std::max(merged.back().last, interval.last);
    } else {
      merged.push_back(interval);
    }
  }
  return merged;
}

// Calls visit(slab) for the rows that the ranges touch, ascending. Ranges that are reversed or
// outside the scheme list nothing.
template <class Visit>
void for_each_slab(const TilingScheme& scheme, std::int32_t zoom, std::vector<TileRange> ranges,
                   const Visit& visit) {
  std::erase_if(ranges, [&](const TileRange& range) {
    return !scheme.contains({.zoom = zoom, .x = range.start_x, .y = range.start_y}) ||
           !scheme.contains({.zoom = zoom, .x = range.end_x, .y = range.end_y}) ||
           range.start_x > range.end_x || range.start_y > range.end_y;
  });
  std::sort(ranges.begin(), ranges.end(),
            [](const TileRange& a, const TileRange& b) { return a.start_y < b.start_y; });
  std::vector<std::int32_t> breaks;
  for (const TileRange& range : ranges) {
    breaks.push_back(range.start_y);
    breaks.push_back(range.end_y + 1);
  }
  std::sort(breaks.begin(), breaks.end());
  breaks.erase(std::unique(breaks.begin(), breaks.end()), breaks.end());
  std::vector<TileRange> active;
  auto next = ranges.begin();
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const std::int32_t y0 = breaks[k];
    std::erase_if(active, [y0](const TileRange& range) { return range.end_y < y0; });
    for (; next != ranges.end() && next->start_y <= y0; ++next) active.push_back(*next);
    if (active.empty()) continue;
    visit(Slab{.y0 = y0, .y1 = breaks[k + 1] - 1, .columns = merged_columns(active)});
  }
}

struct Listing {
  KeyList unlisted;  // of the keys
  KeyList missing;   // listed, but not among the keys
};

// The first listed tiles of the slab that are not among `keys`: each step finds one or passes a key.
void find_missing(const Slab& slab, std::int32_t zoom, std::span<const TileKey> keys,
                  std::int64_t missing, KeyList& out) {
  auto at = keys.begin();
  std::int64_t found = 0;
  for (std::int32_t y = slab.y0; y <= slab.y1; ++y) {
    for (const Interval& interval : slab.columns) {
      for (std::int32_t x = interval.first; x <= interval.last; ++x) {
        if (found == missing || out.first.size() == kExamples) {
          out.count += missing - found;
          return;
        }
        const TileKey key = {.zoom = zoom, .x = x, .y = y};
        while (at != keys.end() && *at < key) ++at;
        if (at != keys.end() && *at == key) continue;
        out.add(key);
        ++found;
      }
    }
  }
}

// REQUIRES: keys sorted, all of the zoom.
Listing compare_listing(const TilingScheme& scheme, std::int32_t zoom,
                        std::span<const TileRange> ranges, std::span<const TileKey> keys) {
  Listing listing;
  std::size_t at = 0;
  for_each_slab(scheme, zoom, {ranges.begin(), ranges.end()}, [&](const Slab& slab) {
    for (; at < keys.size() && keys[at].y < slab.y0; ++at) listing.unlisted.add(keys[at]);
    const std::size_t first = at;
    std::int64_t listed_here = 0;
    for (; at < keys.size() && keys[at].y <= slab.y1; ++at) {
      if (slab.lists_column(keys[at].x)) {
        ++listed_here;
      } else {
        listing.unlisted.add(keys[at]);
      }
    }
    const std::int64_t rows = std::int64_t{slab.y1} - slab.y0 + 1;
    const std::int64_t missing = slab.columns_in_a_row() * rows - listed_here;
    find_missing(slab, zoom, keys.subspan(first, at - first), missing, listing.missing);
  });
  for (; at < keys.size(); ++at) listing.unlisted.add(keys[at]);
  return listing;
}

std::span<const TileKey> keys_of_zoom(const std::vector<TileKey>& keys, std::int32_t zoom) {
  const auto by_zoom = [](const TileKey& a, const TileKey& b) { return a.zoom < b.zoom; };
  const auto [first, last] =
      std::equal_range(keys.begin(), keys.end(), TileKey{.zoom = zoom, .x = 0, .y = 0}, by_zoom);
  return {first, last};
}

class ListingCheck {
 public:
  ListingCheck(const CheckedLayer& layer, const std::vector<TileKey>& keys)
      : scheme_(layer.scheme), parsed_(layer.parsed), keys_(keys) {
    if (!parsed_) return;
    min_zoom_ = std::clamp(parsed_->layer.min_zoom, 0, kMaxZoom + 1);
    lists_tiles_ = !parsed_->metadata_availability.has_value();
    is_layered_ = parsed_->has(LayerFlaw::kParentSet);
  }

  std::vector<Finding> run() {
    if (lists_tiles_) compare_available();
    if (!is_layered_) {
      check_roots();
      check_parents();
    }
    if (parsed_) check_zooms();
    return std::move(findings_);
  }

 private:
  void add(FindingKind kind, const KeyList& tiles, const std::string& text) {
    findings_.push_back({.kind = kind, .key = tiles.first.front(), .text = text});
  }
  std::span<const TileRange> ranges(std::int32_t zoom) const {
    const auto at = static_cast<std::size_t>(zoom);
    if (!lists_tiles_ || at >= parsed_->layer.available.size()) return {};
    return parsed_->layer.available[at];
  }

  void compare_available() {
    for (std::int32_t zoom = 0; zoom <= kMaxZoom; ++zoom) {
      const Listing listing =
          compare_listing(scheme_, zoom, ranges(zoom), keys_of_zoom(keys_, zoom));
      if (listing.unlisted.count > 0) {
        add(FindingKind::kUnlistedTile, listing.unlisted,
            fmt::format("{} of zoom {} not listed in \"available\", so clients never ask: {}",
                        tiles_text(listing.unlisted.count), zoom, listing.unlisted.text()));
      }
      if (listing.missing.count > 0) {
        add(FindingKind::kMissingFile, listing.missing,
            fmt::format("{} of zoom {} listed in \"available\" without a file: {}",
                        tiles_text(listing.missing.count), zoom, listing.missing.text()));
      }
    }
  }

  // Tiles that are needed and neither there nor listed. REQUIRES: needed sorted.
  KeyList absent(std::int32_t zoom, const std::vector<TileKey>& needed) const {
    const std::span<const TileKey> there = keys_of_zoom(keys_, zoom);
    std::vector<TileKey> gone;
    std::set_difference(needed.begin(), needed.end(), there.begin(), there.end(),
                        std::back_inserter(gone));
    return compare_listing(scheme_, zoom, ranges(zoom), gone).unlisted;
  }

  void check_roots() {
    if (min_zoom_ > 0) return;
    const KeyList gone = absent(0, scheme_.roots());
    if (gone.count == 0) return;
    add(FindingKind::kMissingRoot, gone,
        fmt::format("neither there nor listed: {}; clients need every root", gone.text()));
  }

  // Upwards, so that the parents of tiles that are missing themselves are asked for too.
  void check_parents() {
    std::vector<TileKey> needed;
    for (std::int32_t zoom = kMaxZoom; zoom-- > std::max(min_zoom_, 1);) {
      std::vector<TileKey> parents;
      for (const TileKey& key : keys_of_zoom(keys_, zoom + 1)) parents.push_back(parent_of(key));
      for (const TileKey& key : needed) parents.push_back(parent_of(key));
      std::sort(parents.begin(), parents.end());
      parents.erase(std::unique(parents.begin(), parents.end()), parents.end());
      needed = std::move(parents);
      const KeyList gone = absent(zoom, needed);
      if (gone.count == 0) continue;
      add(FindingKind::kMissingParent, gone,
          fmt::format("{} of zoom {} neither there nor listed, with tiles below: {}",
                      tiles_text(gone.count), zoom, gone.text()));
    }
  }

  void check_zooms() {
    if (keys_.empty()) return;
    const std::int32_t shallowest = keys_.front().zoom;
    const std::int32_t deepest = keys_.back().zoom;
    const LayerJson& layer = parsed_->layer;
    if (layer.max_zoom > deepest) {
      findings_.push_back(
          finding_of(FindingKind::kLayerJsonAdvice,
                     fmt::format("\"maxzoom\" is {}, but the deepest tile is of zoom {}",
                                 layer.max_zoom, deepest)));
    } else if (layer.max_zoom < deepest && parsed_->has_max_zoom && !lists_tiles_) {
      findings_.push_back(finding_of(
          FindingKind::kLayerJson,
          fmt::format("\"maxzoom\" is {}, but there are tiles down to zoom {}: clients will not "
                      "show them",
                      layer.max_zoom, deepest)));
    }
    if (shallowest < layer.min_zoom) {
      findings_.push_back(
          finding_of(FindingKind::kLayerJsonAdvice,
                     fmt::format("\"minzoom\" is {}, but there are tiles of zoom {}",
                                 layer.min_zoom, shallowest)));
    }
  }

  TilingScheme scheme_;
  const std::optional<ParsedLayerJson>& parsed_;
  const std::vector<TileKey>& keys_;
  std::int32_t min_zoom_ = 0;
  bool lists_tiles_ = false;  // and so there is a layer.json
  bool is_layered_ = false;
  std::vector<Finding> findings_;
};

// What the schema leaves open, or what this program does not follow.
bool is_advice(LayerFlaw flaw) {
  return flaw == LayerFlaw::kNoVersion || flaw == LayerFlaw::kNoBounds ||
         flaw == LayerFlaw::kParentSet;
}

}  // namespace

CheckedLayer check_layer(const TileSet& tile_set) {
  CheckedLayer layer;
  const auto add = [&layer](FindingKind kind, const std::string& text) {
    layer.findings.push_back(finding_of(kind, text));
  };
  const Result<std::string> text = tile_set.layer_text();
  if (!text) {
    add(FindingKind::kLayerJson, text.error().message);
    return layer;
  }
  Result<ParsedLayerJson> parsed = parse_layer_json(*text);
  if (!parsed) {
    add(FindingKind::kLayerJson, parsed.error().message);
    return layer;
  }
  for (const LayerComplaint& complaint : parsed->complaints) {
    add(is_advice(complaint.flaw) ? FindingKind::kLayerJsonAdvice : FindingKind::kLayerJson,
        complaint.text);
  }
  for (const std::string& url : parsed->layer.tile_urls) {
    for (const std::string_view part : {"{z}", "{x}", "{y}"}) {
      if (url.find(part) != std::string::npos) continue;
      add(FindingKind::kLayerJson,
          fmt::format("the address \"{}\" in \"tiles\" has no {}", url, part));
    }
  }
  if (parsed->metadata_availability && *parsed->metadata_availability < 1) {
    add(FindingKind::kLayerJson,
        fmt::format("\"metadataAvailability\" is {}, which is no number of "
                    "levels",
                    *parsed->metadata_availability));
  } else if (parsed->metadata_availability) {
    add(FindingKind::kNotChecked,
        "with \"metadataAvailability\" clients learn from the tiles which tiles there are; that is "
        "not compared with the files");
  }
  layer.scheme = TilingScheme(parsed->layer.projection);
  layer.parsed = std::move(*parsed);
  return layer;
}

TilesInScheme tiles_in_scheme(const TileSet& tile_set, const TilingScheme& scheme) {
  TilesInScheme tiles;
  KeyList outside;
  for (const TileKey& key : tile_set.keys()) {
    if (scheme.contains(key)) {
      tiles.keys.push_back(key);
    } else {
      outside.add(key);
    }
  }
  if (outside.count > 0) {
    tiles.findings.push_back({.kind = FindingKind::kOutsideScheme,
                              .key = outside.first.front(),
                              .text = fmt::format("{} beyond the scheme's columns or rows: {}",
                                                  tiles_text(outside.count), outside.text())});
  }
  return tiles;
}

std::vector<Finding> check_listing(const CheckedLayer& layer, const std::vector<TileKey>& keys,
                                   const std::vector<std::string>& strays) {
  std::vector<Finding> findings = ListingCheck(layer, keys).run();
  if (!strays.empty()) {
    const auto shown = std::min(strays.size(), kExamples);
    findings.push_back(
        finding_of(FindingKind::kStrayFile,
                   fmt::format("{} files look like tiles and can be none: {}{}", strays.size(),
                               fmt::join(std::span(strays).first(shown), ", "),
                               strays.size() > shown ? ", ..." : "")));
  }
  return findings;
}

}  // namespace qmpipe::verify
