#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>

#include "formats/tile/layer_json.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

constexpr std::size_t kDeepestNesting = 64;
// An ordered object looks its keys up one after the other.
constexpr int kMostKeys = 1000;

// Finds out what is wrong with a text, without building anything: the message that the quiet
// parser does not give, nesting that would overflow the stack when it is written again, and objects
// that would take for ever to build.
class SyntaxCheck : public nlohmann::json_sax<Json> {
 public:
  std::string fault;

  bool null() override { return true; }
  bool boolean(bool) override { return true; }
  bool number_integer(number_integer_t) override { return true; }
  bool number_unsigned(number_unsigned_t) override { return true; }
  bool number_float(number_float_t, const string_t&) override { return true; }
  bool string(string_t&) override { return true; }
  bool binary(binary_t&) override { return true; }
  bool key(string_t&) override {
    if (++keys_[depth_] <= kMostKeys) return true;
    fault = fmt::format("an object has more than {} keys", kMostKeys);
    return false;
  }
  bool start_object(std::size_t) override { return enter(); }
  bool start_array(std::size_t) override { return enter(); }
  bool end_object() override { return leave(); }
  bool end_array() override { return leave(); }
  bool parse_error(std::size_t position, const std::string& last_token,
                   const nlohmann::detail::exception&) override {
    fault = fmt::format(
        "no valid JSON at byte {} (\"{}\")", position,
        last_token.substr(last_token.size() - std::min<std::size_t>(last_token.size(), 40)));
    return false;
  }

 private:
  bool enter() {
    if (depth_ == kDeepestNesting) {
      fault = fmt::format("nested deeper than {} levels", kDeepestNesting);
      return false;
    }
    keys_[++depth_] = 0;
    return true;
  }
  bool leave() {
    --depth_;
    return true;
  }
  std::size_t depth_ = 0;
  // Keys so far of each object that is open.
  std::array<int, kDeepestNesting + 1> keys_{};
};

// Reads key by key; the first fault wins, and what follows it is of no account.
class LayerParser {
 public:
  explicit LayerParser(const Json& root) : root_(root) {}

  Result<ParsedLayerJson> run() {
    LayerJson& layer = parsed_.layer;
    layer.name = text("name", "");
    layer.description = text("description", "");
    layer.attribution = text("attribution", "");
    read_version();
    read_format_and_scheme();
    read_projection();
    layer.extensions = texts("extensions");
    layer.tile_urls = texts("tiles");
    if (layer.tile_urls.empty())
      complain(LayerFlaw::kNoTiles, "no \"tiles\": clients cannot build a tile's address");
    read_bounds();
    read_available();
    read_zooms();
    read_others();
    if (!fault_.empty()) return Error{"layer.json: " + fault_};
    return std::move(parsed_);
  }

 private:
  const Json* find(const char* key) const {
    const auto it = root_.find(key);
    return it == root_.end() ? nullptr : &*it;
  }
  void fail(const std::string& fault) {
    if (fault_.empty()) fault_ = fault;
  }
  void complain(LayerFlaw flaw, std::string text) {
    parsed_.complaints.push_back({.flaw = flaw, .text = std::move(text)});
  }

  std::string as_text(const Json& value, const std::string& name) {
    if (value.is_string()) return value.get<std::string>();
    fail(fmt::format("\"{}\" is {}, not a text", name, value.type_name()));
    return "";
  }

  std::int32_t as_integer(const Json& value, const std::string& name) {
    constexpr double kMax = std::numeric_limits<std::int32_t>::max();
    if (value.is_number()) {
      const double number = value.get<double>();
      if (number == std::floor(number) && std::abs(number) <= kMax) {
        return static_cast<std::int32_t>(number);
      }
    }
    fail(fmt::format("\"{}\" is no whole number of 32 bits", name));
    return 0;
  }

  std::string text(const char* key, const char* fallback) {
    const Json* value = find(key);
    return value == nullptr ? fallback : as_text(*value, key);
  }

  std::vector<std::string> texts(const char* key) {
    std::vector<std::string> result;
    const Json* value = find(key);
    if (value == nullptr) return result;
    if (!value->is_array()) fail(fmt::format("\"{}\" is no list", key));
    for (const Json& item : *value) result.push_back(as_text(item, key));
    return result;
  }

  void read_version() {
    if (find("version") == nullptr) complain(LayerFlaw::kNoVersion, "no \"version\"");
    parsed_.layer.version = text("version", "");
  }

  void read_format_and_scheme() {
    parsed_.format = text("format", "");
    if (find("format") == nullptr) {
      complain(LayerFlaw::kNoFormat, "no \"format\": CesiumJS refuses the set");
    } else if (!parsed_.format.starts_with("quantized-mesh-1.")) {
      complain(LayerFlaw::kOtherFormat,
               fmt::format("the format is \"{}\", not \"quantized-mesh-1.0\"", parsed_.format));
    }
    parsed_.scheme = text("scheme", "");
    if (find("scheme") == nullptr && find("schema") != nullptr) {
      parsed_.scheme = text("schema", "");
      complain(LayerFlaw::kSchemaForScheme, "\"schema\" stands where \"scheme\" is meant");
    }
    if (parsed_.scheme.empty()) {
      parsed_.scheme = "tms";
    } else if (parsed_.scheme != "tms") {
      complain(LayerFlaw::kOtherScheme,
               fmt::format("the scheme is \"{}\"; the specification knows \"tms\" only",
                           parsed_.scheme));
    }
  }

  void read_projection() {
    const std::string projection = text("projection", "EPSG:4326");
    if (projection == "EPSG:3857") {
      parsed_.layer.projection = Projection::kMercator;
    } else if (projection != "EPSG:4326") {
      fail(fmt::format("the projection is \"{}\"; EPSG:4326 and EPSG:3857 are possible",
                       projection));
    }
  }

  void read_bounds() {
    const Json* bounds = find("bounds");
    if (bounds == nullptr) return complain(LayerFlaw::kNoBounds, "no \"bounds\"");
    if (!bounds->is_array() || bounds->size() != 4 ||
        !std::all_of(bounds->begin(), bounds->end(),
                     [](const Json& value) { return value.is_number(); })) {
      return fail("\"bounds\" is no list of four numbers");
    }
    parsed_.layer.bounds_deg = {.west_deg = (*bounds)[0].get<double>(),
                                .south_deg = (*bounds)[1].get<double>(),
                                .east_deg = (*bounds)[2].get<double>(),
                                .north_deg = (*bounds)[3].get<double>()};
    judge_bounds(parsed_.layer.bounds_deg);
  }

  // West may lie east of east: across the antimeridian.
  void judge_bounds(const RectangleDeg& bounds) {
    // Some programs write the edge of a raster, which lies a pixel's rounding beyond.
    constexpr double kSlack = 1e-6;
    const auto is_within = [](double value, double most) {
      return std::abs(value) <= most + kSlack;
    };
    if (is_within(bounds.west_deg, 180) && is_within(bounds.east_deg, 180) &&
        is_within(bounds.south_deg, 90) && is_within(bounds.north_deg, 90) &&
        bounds.south_deg <= bounds.north_deg) {
      return;
    }
    complain(LayerFlaw::kBounds,
             fmt::format("\"bounds\" are {:g}, {:g}, {:g}, {:g}, which is no rectangle in degrees",
                         bounds.west_deg, bounds.south_deg, bounds.east_deg, bounds.north_deg));
  }

  std::int32_t range_part(const Json& range, const char* key) {
    const auto it = range.find(key);
    if (it != range.end()) return as_integer(*it, key);
    fail(fmt::format("a range in \"available\" has no \"{}\"", key));
    return 0;
  }

  TileRange read_range(const Json& value) {
    if (!value.is_object()) {
      fail("\"available\" is no list of lists of ranges");
      return {};
    }
    return {.start_x = range_part(value, "startX"),
            .start_y = range_part(value, "startY"),
            .end_x = range_part(value, "endX"),
            .end_y = range_part(value, "endY")};
  }

  bool is_in_scheme(const TileRange& range, std::size_t zoom) const {
    const auto fits = [&](std::int32_t x, std::int32_t y) {
      return zoom <= static_cast<std::size_t>(kMaxZoom) &&
             TilingScheme(parsed_.layer.projection)
                 .contains({.zoom = static_cast<std::int32_t>(zoom), .x = x, .y = y});
    };
    return fits(range.start_x, range.start_y) && fits(range.end_x, range.end_y) &&
           range.start_x <= range.end_x && range.start_y <= range.end_y;
  }

  void read_available() {
    const Json* available = find("available");
    if (available == nullptr) return;
    if (!available->is_array()) return fail("\"available\" is no list");
    for (const Json& ranges : *available) {
      if (!ranges.is_array()) return fail("\"available\" is no list of lists of ranges");
      const std::size_t zoom = parsed_.layer.available.size();
      std::vector<TileRange>& out = parsed_.layer.available.emplace_back();
      for (const Json& range : ranges) out.push_back(read_range(range));
      const auto bad = std::count_if(out.begin(), out.end(), [&](const TileRange& range) {
        return !is_in_scheme(range, zoom);
      });
      if (bad > 0) {
        complain(LayerFlaw::kRanges,
                 fmt::format("{} ranges of zoom {} are reversed or outside the tiling scheme", bad,
                             zoom));
      }
    }
  }

  void read_zooms() {
    std::int32_t deepest = 0;
    for (std::size_t zoom = 0; zoom < parsed_.layer.available.size(); ++zoom) {
      if (!parsed_.layer.available[zoom].empty()) deepest = static_cast<std::int32_t>(zoom);
    }
    if (const Json* min_zoom = find("minzoom")) {
      parsed_.layer.min_zoom = as_integer(*min_zoom, "minzoom");
    }
    const Json* max_zoom = find("maxzoom");
    parsed_.has_max_zoom = max_zoom != nullptr;
    parsed_.layer.max_zoom = max_zoom != nullptr ? as_integer(*max_zoom, "maxzoom") : deepest;
    // No tile of 32-bit numbers lies deeper.
    constexpr std::int32_t kDeepest = 30;
    const std::int32_t lowest = parsed_.layer.min_zoom;
    const std::int32_t highest = parsed_.layer.max_zoom;
    if (lowest < 0 || highest > kDeepest || (parsed_.has_max_zoom && lowest > highest)) {
      complain(LayerFlaw::kZooms,
               fmt::format("\"minzoom\" {} and \"maxzoom\" {} are no zooms that a set can have",
                           lowest, highest));
    }
    if (!parsed_.has_max_zoom) {
      complain(LayerFlaw::kNoMaxZoom, "no \"maxzoom\": CesiumJS looks tiles up slowly without it");
    } else if (parsed_.layer.max_zoom < deepest) {
      complain(LayerFlaw::kDeepestZoom,
               fmt::format("\"maxzoom\" is {}, but tiles are available down to zoom {}: clients "
                           "will not show them",
                           parsed_.layer.max_zoom, deepest));
    }
  }

  void read_others() {
    if (const Json* levels = find("metadataAvailability")) {
      parsed_.metadata_availability = as_integer(*levels, "metadataAvailability");
      if (*parsed_.metadata_availability > 30) {
        complain(LayerFlaw::kMetadataLevels,
                 fmt::format("\"metadataAvailability\" is {}, more levels than there can be",
                             *parsed_.metadata_availability));
      }
    } else if (find("available") == nullptr) {
      complain(LayerFlaw::kNoAvailability,
               "neither \"available\" nor \"metadataAvailability\": CesiumJS shows no tile");
    }
    if (find("parentUrl") != nullptr) {
      complain(LayerFlaw::kParentSet, "\"parentUrl\" names another set, which is not looked at");
    }
    const Json* ours = find("qmpipe");
    if (ours == nullptr) return;
    if (!ours->is_object()) return fail("\"qmpipe\" is no object");
    parsed_.layer.qmpipe_json = ours->dump();
  }

  const Json& root_;
  ParsedLayerJson parsed_;
  std::string fault_;
};

}  // namespace

bool ParsedLayerJson::has(LayerFlaw flaw) const {
  return std::any_of(complaints.begin(), complaints.end(),
                     [flaw](const LayerComplaint& complaint) { return complaint.flaw == flaw; });
}

Result<ParsedLayerJson> parse_layer_json(const std::string& text) {
  SyntaxCheck syntax;
  if (!Json::sax_parse(text, &syntax)) {
    return Error{"layer.json: " + (syntax.fault.empty() ? "no valid JSON" : syntax.fault)};
  }
  const Json root = Json::parse(text, nullptr, false);
  if (!root.is_object()) return Error{"layer.json: no JSON object"};
  return LayerParser(root).run();
}

}  // namespace qmpipe
