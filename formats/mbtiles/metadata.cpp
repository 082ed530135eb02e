#include "formats/mbtiles/metadata.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/tile/layer_json.h"

namespace qmpipe {
namespace {

using Rows = std::vector<std::pair<std::string, std::string>>;

// The zoom at which the bounds fill about one tile: what a viewer should show first.
std::int32_t first_zoom(const RectangleDeg& bounds, const ZoomSpan& zooms) {
  const double size_deg =
      std::max(bounds.east_deg - bounds.west_deg, bounds.north_deg - bounds.south_deg);
  const double zoom = std::ilogb(180 / size_deg);
  return static_cast<std::int32_t>(std::clamp<double>(zoom, zooms.min_zoom, zooms.max_zoom));
}

void add_place(const RectangleDeg& bounds, const std::optional<ZoomSpan>& zooms, Rows& rows) {
  // Other programs' sets may have none.
  if (!(bounds.west_deg < bounds.east_deg) || !(bounds.south_deg < bounds.north_deg)) return;
  // Or numbers that lie nowhere.
  if (!(bounds.east_deg - bounds.west_deg <= 720) || !(std::abs(bounds.west_deg) <= 720) ||
      !(std::abs(bounds.south_deg) <= 90) || !(std::abs(bounds.north_deg) <= 90)) {
    return;
  }
  rows.emplace_back("bounds", fmt::format("{},{},{},{}", bounds.west_deg, bounds.south_deg,
                                          bounds.east_deg, bounds.north_deg));
  if (!zooms) return;
  rows.emplace_back(
      "center", fmt::format("{},{},{}", (bounds.west_deg + bounds.east_deg) / 2,
                            (bounds.south_deg + bounds.north_deg) / 2, first_zoom(bounds, *zooms)));
}

}  // namespace

Rows mbtiles_metadata(const std::string& layer_json, const std::optional<ZoomSpan>& zooms,
                      const std::string& name) {
  const Result<ParsedLayerJson> parsed = parse_layer_json(layer_json);
  const bool has_name = parsed && !parsed->layer.name.empty();
  Rows rows = {{"name", has_name ? parsed->layer.name : name},
               {"format", "application/vnd.quantized-mesh"},
               {"type", "baselayer"},
               {"scheme", "tms"}};
  if (zooms) {
    rows.emplace_back("minzoom", std::to_string(zooms->min_zoom));
    rows.emplace_back("maxzoom", std::to_string(zooms->max_zoom));
  }
  if (parsed) {
    const LayerJson& layer = parsed->layer;
    add_place(layer.bounds_deg, zooms, rows);
    const std::pair<const char*, std::string> texts[] = {{"attribution", layer.attribution},
                                                         {"description", layer.description},
                                                         {"version", layer.version}};
    for (const auto& [key, text] : texts) {
      if (!text.empty()) rows.emplace_back(key, text);
    }
    rows.emplace_back("crs", layer.projection == Projection::kGeodetic ? "EPSG:4326" : "EPSG:3857");
  }
  rows.emplace_back("layer.json", layer_json);
  return rows;
}

}  // namespace qmpipe
