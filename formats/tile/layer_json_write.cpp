#include <cmath>
#include <nlohmann/json.hpp>

#include "formats/tile/layer_json.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

std::string quoted(const std::string& text) {
  return Json(text).dump(-1, ' ', false, Json::error_handler_t::replace);
}

// ["a", "b"] from texts that are JSON already.
std::string list_of(const std::vector<std::string>& items) {
  std::string text = "[";
  for (const std::string& item : items) text += (text.size() == 1 ? "" : ", ") + item;
  return text + "]";
}

std::string list_of_texts(const std::vector<std::string>& texts) {
  std::vector<std::string> items;
  for (const std::string& text : texts) items.push_back(quoted(text));
  return list_of(items);
}

std::string bounds_text(const RectangleDeg& bounds) {
  std::vector<std::string> items;
  for (const double value :
       {bounds.west_deg, bounds.south_deg, bounds.east_deg, bounds.north_deg}) {
    QMPIPE_CHECK(std::isfinite(value));
    items.push_back(Json(value).dump());
  }
  return list_of(items);
}

std::string range_text(const TileRange& range) {
  return "{\"startX\": " + std::to_string(range.start_x) +
         ", \"startY\": " + std::to_string(range.start_y) +
         ", \"endX\": " + std::to_string(range.end_x) +
         ", \"endY\": " + std::to_string(range.end_y) + "}";
}

// A line for each range, which diff and people can read.
std::string available_text(const std::vector<std::vector<TileRange>>& available) {
  std::string text = "[";
  for (std::size_t zoom = 0; zoom < available.size(); ++zoom) {
    text += zoom == 0 ? "\n    [" : ",\n    [";
    for (std::size_t i = 0; i < available[zoom].size(); ++i) {
      text += (i == 0 ? "\n      " : ",\n      ") + range_text(available[zoom][i]);
    }
    text += available[zoom].empty() ? "]" : "\n    ]";
  }
  return text + (available.empty() ? "]" : "\n  ]");
}

std::string indented_object(const std::string& json) {
  const Json value = Json::parse(json, nullptr, false);
  QMPIPE_CHECK(value.is_object());
  std::string text;
  for (const char c : value.dump(2)) {
    text += c;
    if (c == '\n') text += "  ";
  }
  return text;
}

}  // namespace

std::string write_layer_json(const LayerJson& layer) {
  std::string text = "{";
  const auto add = [&text](const char* key, const std::string& value) {
    text += std::string(text.size() == 1 ? "\n  \"" : ",\n  \"") + key + "\": " + value;
  };
  const auto add_text = [&add](const char* key, const std::string& value) {
    if (!value.empty()) add(key, quoted(value));
  };
  const bool is_geodetic = layer.projection == Projection::kGeodetic;
  add("tilejson", "\"2.1.0\"");
  add_text("name", layer.name);
  add_text("description", layer.description);
  add("version", quoted(layer.version));
  add("format", "\"quantized-mesh-1.0\"");
  add_text("attribution", layer.attribution);
  add("scheme", "\"tms\"");
  add("projection", is_geodetic ? "\"EPSG:4326\"" : "\"EPSG:3857\"");
  if (!layer.extensions.empty()) add("extensions", list_of_texts(layer.extensions));
  add("tiles", list_of_texts(layer.tile_urls));
  add("minzoom", std::to_string(layer.min_zoom));
  add("maxzoom", std::to_string(layer.max_zoom));
  add("bounds", bounds_text(layer.bounds_deg));
  add("available", available_text(layer.available));
  if (!layer.qmpipe_json.empty()) add("qmpipe", indented_object(layer.qmpipe_json));
  return text + "\n}\n";
}

}  // namespace qmpipe
