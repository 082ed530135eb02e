#include "formats/tile_sets/fit_layer_json.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>
#include <utility>

#include "formats/tile/layer_json.h"
#include "formats/tile/quantized_mesh.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kTemplate = "{z}/{x}/{y}.terrain";
constexpr const char* kVersionedTemplate = "{z}/{x}/{y}.terrain?v={version}";

using KeysByZoom = std::vector<std::vector<TileKey>>;

KeysByZoom by_zoom(const std::vector<TileKey>& keys) {
  KeysByZoom zooms;
  for (const TileKey& key : keys) {
    zooms.resize(std::max(zooms.size(), static_cast<std::size_t>(key.zoom) + 1));
    zooms[static_cast<std::size_t>(key.zoom)].push_back(key);
  }
  return zooms;
}

// The first, the middle and the last tile of the deepest zoom, as far as they can be read.
std::vector<std::pair<TileKey, QuantizedMesh>> sample_of(const TileSet& tile_set) {
  std::vector<std::pair<TileKey, QuantizedMesh>> sample;
  const KeysByZoom zooms = by_zoom(tile_set.keys());
  if (zooms.empty()) return sample;
  const std::vector<TileKey>& deepest = zooms.back();
  std::optional<TileKey> last;
  for (const std::size_t at : {std::size_t{0}, deepest.size() / 2, deepest.size() - 1}) {
    const TileKey& key = deepest[at];
    if (std::exchange(last, key) == key) continue;
    auto stored = tile_set.read(key);
    if (!stored) continue;
    const auto plain = plain_tile_bytes(std::move(*stored));
    if (!plain) continue;
    auto mesh = decode(*plain);
    if (mesh) sample.emplace_back(key, std::move(*mesh));
  }
  return sample;
}

// A tile's longitude tells the schemes apart, which have twice the columns or not.
Projection guess_projection(const std::vector<std::pair<TileKey, QuantizedMesh>>& sample) {
  double geodetic_off_deg = 0;
  double mercator_off_deg = 0;
  const auto off_deg = [](double a_deg, double b_deg) {
    return std::abs(std::remainder(a_deg - b_deg, 360.0));
  };
  for (const auto& [key, mesh] : sample) {
    const Vec3& centre = mesh.header.sphere_centre_ecef_m;
    const double longitude_deg = atan2_deg(centre[1], centre[0]);
    if (!std::isfinite(longitude_deg)) continue;
    const double middle = std::ldexp(key.x + 0.5, -key.zoom);
    geodetic_off_deg += off_deg(longitude_deg, middle * 180 - 180);
    mercator_off_deg += off_deg(longitude_deg, middle * 360 - 180);
  }
  return mercator_off_deg < geodetic_off_deg ? Projection::kMercator : Projection::kGeodetic;
}

class Fitter {
 public:
  Fitter(const TileSet& tile_set, const std::string& name)
      : sample_(sample_of(tile_set)), zooms_(by_zoom(tile_set.keys())) {
    auto text = tile_set.layer_text();
    auto parsed = text ? parse_layer_json(*text) : Result<ParsedLayerJson>(text.error());
    if (parsed) {
      text_ = std::move(*text);
      json_ = Json::parse(text_);
      parsed_ = std::move(*parsed);
    } else {
      start_anew(name, parsed.error().message);
    }
  }

  FittedLayer run() {
    fit_format();
    fit_scheme();
    fit_tiles();
    if (!parsed_.metadata_availability) fit_available();
    fit_bounds();
    fit_max_zoom();
    fit_extension("octvertexnormals", [](const QuantizedMesh& m) { return !m.normals.empty(); });
    fit_extension("watermask", [](const QuantizedMesh& m) { return !m.water_mask.empty(); });
    if (!is_new_ && changes_.empty()) return {.text = std::move(text_), .changes = {}};
    return {.text = json_.dump(2, ' ', false, Json::error_handler_t::replace) + "\n",
            .changes = std::move(changes_)};
  }

 private:
  void start_anew(const std::string& name, const std::string& reason) {
    LayerJson layer;
    layer.name = name;
    layer.projection = guess_projection(sample_);
    const TilingScheme scheme(layer.projection);
    if (!zooms_.empty() && scheme.contains(zooms_.back().back())) {
      layer.bounds_deg = bounds_of_deepest(zooms_.back(), TilingScheme(layer.projection));
    }
    json_ = Json::parse(write_layer_json(layer));
    parsed_ = *parse_layer_json(json_.dump());
    is_new_ = true;
    changes_.push_back(
        fmt::format("it is made from the tiles ({}, taken for {})", reason,
                    layer.projection == Projection::kGeodetic ? "EPSG:4326" : "EPSG:3857"));
  }

  // What is new need not be told piece by piece.
  void change(std::string sentence) {
    if (!is_new_) changes_.push_back(std::move(sentence));
  }

  void fit_format() {
    if (parsed_.format.starts_with("quantized-mesh-1.")) return;
    json_["format"] = "quantized-mesh-1.0";
    change(fmt::format("the format is quantized-mesh-1.0 instead of \"{}\"", parsed_.format));
  }

  // Clients know slippyMap too: it says how the tiles' files are numbered.
  bool counts_from_north() const { return parsed_.scheme == "slippyMap"; }

  void fit_scheme() {
    const bool is_misspelt = json_.contains("schema") && !json_.contains("scheme");
    if (!is_misspelt && (parsed_.scheme == "tms" || counts_from_north())) return;
    json_.erase("schema");
    json_["scheme"] = counts_from_north() ? "slippyMap" : "tms";
    change(fmt::format("the scheme is {}", json_["scheme"].get<std::string>()));
  }

  void fit_tiles() {
    const std::vector<std::string>& urls = parsed_.layer.tile_urls;
    const bool fits =
        !urls.empty() && std::all_of(urls.begin(), urls.end(), [](const std::string& url) {
          const std::string path = url.substr(0, url.find('?'));
          return path == kTemplate || path == "./" + std::string(kTemplate);
        });
    if (fits) return;
    const char* url = parsed_.layer.version.empty() ? kTemplate : kVersionedTemplate;
    json_["tiles"] = Json::array({url});
    change(fmt::format("\"tiles\" is {}", url));
  }

  // Rows count from the south in `available`, whatever the scheme.
  std::vector<TileKey> listed_keys(std::size_t zoom) const {
    std::vector<TileKey> keys = zooms_[zoom];
    if (!counts_from_north()) return keys;
    for (TileKey& key : keys) key.y = (std::int32_t{1} << key.zoom) - 1 - key.y;
    std::sort(keys.begin(), keys.end());
    return keys;
  }

  static bool covers_exactly(const std::vector<TileRange>& ranges,
                             const std::vector<TileKey>& keys) {
    std::vector<TileKey> listed;
    for (const TileRange& range : ranges) {
      if (range.start_x > range.end_x || range.start_y > range.end_y) return false;
      const std::int64_t wide = std::int64_t{range.end_x} - range.start_x + 1;
      const std::int64_t high = std::int64_t{range.end_y} - range.start_y + 1;
      // Numbers of 32 bits: the product is at most 2^64, so one factor is looked at alone.
      const auto room = static_cast<std::int64_t>(keys.size() - listed.size());
      if (wide > room || high > room || wide * high > room) return false;
      // In 64 bits, so that the last number of 32 has a next one.
      for (std::int64_t x = range.start_x; x <= range.end_x; ++x) {
        for (std::int64_t y = range.start_y; y <= range.end_y; ++y) {
          listed.push_back({.zoom = keys.front().zoom,
                            .x = static_cast<std::int32_t>(x),
                            .y = static_cast<std::int32_t>(y)});
        }
      }
    }
    std::sort(listed.begin(), listed.end());
    return listed == keys;
  }

  void fit_available() {
    std::vector<std::vector<TileRange>> available;
    const auto& lists_given = parsed_.layer.available;
    bool fits = true;
    for (std::size_t zoom = zooms_.size(); zoom < lists_given.size(); ++zoom) {
      fits = fits && lists_given[zoom].empty();
    }
    for (std::size_t zoom = 0; zoom < zooms_.size(); ++zoom) {
      const std::vector<TileKey> keys = listed_keys(zoom);
      available.push_back(merge_ranges(keys));
      fits = fits && zoom < lists_given.size() && covers_exactly(lists_given[zoom], keys);
    }
    if (fits) return;
    Json lists = Json::array();
    for (const auto& ranges : available) {
      Json& list = lists.emplace_back(Json::array());
      for (const TileRange& range : ranges) {
        list.push_back({{"startX", range.start_x},
                        {"startY", range.start_y},
                        {"endX", range.end_x},
                        {"endY", range.end_y}});
      }
    }
    json_["available"] = std::move(lists);
    change("\"available\" lists the tiles that are there");
  }

  void fit_bounds() {
    if (!parsed_.has(LayerFlaw::kBounds)) return;
    json_.erase("bounds");
    change("\"bounds\" is left out");
  }

  void fit_max_zoom() {
    const auto deepest = static_cast<std::int32_t>(zooms_.size()) - 1;
    const bool is_wrong = parsed_.has(LayerFlaw::kZooms);
    if (is_wrong) {
      json_.erase("minzoom");
      change("\"minzoom\" is left out");
    }
    if (!is_wrong && parsed_.has_max_zoom && parsed_.layer.max_zoom >= deepest) return;
    json_["maxzoom"] = std::max(deepest, 0);
    change(fmt::format("\"maxzoom\" is {}", std::max(deepest, 0)));
  }

  template <class Has>
  void fit_extension(const char* extension, const Has& has) {
    const auto& listed = parsed_.layer.extensions;
    if (std::find(listed.begin(), listed.end(), extension) != listed.end()) return;
    const bool all_have_it =
        !sample_.empty() && std::all_of(sample_.begin(), sample_.end(),
                                        [&](const auto& tile) { return has(tile.second); });
    if (!all_have_it) return;
    json_["extensions"].push_back(extension);
    change(fmt::format("\"extensions\" lists {}", extension));
  }

  std::vector<std::pair<TileKey, QuantizedMesh>> sample_;
  KeysByZoom zooms_;
  std::string text_;
  Json json_;
  ParsedLayerJson parsed_;
  bool is_new_ = false;
  std::vector<std::string> changes_;
};

}  // namespace

FittedLayer fit_layer_json(const TileSet& tile_set, const std::string& name) {
  return Fitter(tile_set, name).run();
}

}  // namespace qmpipe
