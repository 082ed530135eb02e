#include <fmt/format.h>

#include <algorithm>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/bytes/printable.h"
#include "formats/tile/layer_json.h"
#include "formats/tile_sets/open_tile_set.h"
#include "tools/commands/info_report.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostStraysShown = 10;

struct ZoomFacts {
  std::int64_t tiles = 0;
  std::int64_t bytes = 0;
  std::int64_t min_bytes = 0;
  std::int64_t max_bytes = 0;

  double mean_bytes() const {
    return tiles == 0 ? 0 : static_cast<double>(bytes) / static_cast<double>(tiles);
  }
  void add(const ZoomFacts& other) {
    if (other.tiles == 0) return;
    min_bytes = tiles == 0 ? other.min_bytes : std::min(min_bytes, other.min_bytes);
    max_bytes = std::max(max_bytes, other.max_bytes);
    tiles += other.tiles;
    bytes += other.bytes;
  }
};

struct TileSetFacts {
  std::optional<ParsedLayerJson> layer;
  std::map<std::int32_t, ZoomFacts> zooms;
  std::vector<std::string> complaints;
};

void complain_of_counts(TileSetFacts& facts) {
  if (!facts.layer || facts.layer->metadata_availability) return;
  const auto& available = facts.layer->layer.available;
  // A double, since a foreign file may list any rectangles.
  std::map<std::int32_t, double> listed;
  for (const auto& [zoom, zoom_facts] : facts.zooms) listed[zoom] = 0;
  for (std::size_t zoom = 0; zoom < available.size(); ++zoom) {
    for (const TileRange& range : available[zoom]) {
      listed[static_cast<std::int32_t>(zoom)] +=
          (1.0 + range.end_x - range.start_x) * (1.0 + range.end_y - range.start_y);
    }
  }
  for (const auto& [zoom, count] : listed) {
    const auto it = facts.zooms.find(zoom);
    const std::int64_t tiles = it == facts.zooms.end() ? 0 : it->second.tiles;
    if (count == static_cast<double>(tiles)) continue;
    facts.complaints.push_back(
        fmt::format("zoom {}: layer.json lists {} tiles, {} are there", zoom, count, tiles));
  }
}

void complain_of_strays(const std::vector<std::string>& strays, TileSetFacts& facts) {
  const std::size_t shown = std::min(strays.size(), kMostStraysShown);
  for (std::size_t i = 0; i < shown; ++i) {
    facts.complaints.push_back(
        fmt::format("{} looks like a tile, but belongs to no scheme", strays[i]));
  }
  if (strays.size() > shown) {
    facts.complaints.push_back(fmt::format("{} more of these", strays.size() - shown));
  }
}

TileSetFacts facts_of(const TileSet& tiles) {
  TileSetFacts facts;
  const Result<std::string> text = tiles.layer_text();
  if (text) {
    const Result<ParsedLayerJson> parsed = parse_layer_json(*text);
    if (parsed) {
      facts.layer = *parsed;
      for (const LayerComplaint& complaint : parsed->complaints) {
        facts.complaints.push_back(complaint.text);
      }
    } else {
      facts.complaints.push_back(parsed.error().message);
    }
  } else {
    facts.complaints.push_back(text.error().message);
  }
  for (const TileKey& key : tiles.keys()) {
    const Result<std::int64_t> bytes = tiles.stored_bytes(key);
    if (bytes) {
      facts.zooms[key.zoom].add(
          {.tiles = 1, .bytes = *bytes, .min_bytes = *bytes, .max_bytes = *bytes});
    } else {
      facts.complaints.push_back(bytes.error().message);
    }
  }
  complain_of_counts(facts);
  complain_of_strays(tiles.strays(), facts);
  return facts;
}

ZoomFacts total_of(const TileSetFacts& facts) {
  ZoomFacts total;
  for (const auto& [zoom, zoom_facts] : facts.zooms) total.add(zoom_facts);
  return total;
}

const char* crs_of(Projection projection) {
  return projection == Projection::kGeodetic ? "EPSG:4326" : "EPSG:3857";
}

void print_layer(const ParsedLayerJson& parsed) {
  const LayerJson& layer = parsed.layer;
  const auto line = [](const char* name, const std::string& value) {
    if (!value.empty()) fmt::print("{:<13}{}\n", name, printable_line(value));
  };
  line("name", layer.name);
  line("description", layer.description);
  line("attribution", layer.attribution);
  line("version", layer.version);
  line("format", parsed.format);
  line("scheme", fmt::format("{}, {}", parsed.scheme, crs_of(layer.projection)));
  line("tiles", fmt::format("{}", fmt::join(layer.tile_urls, " ")));
  line("extensions",
       layer.extensions.empty() ? "none" : fmt::format("{}", fmt::join(layer.extensions, " ")));
  line("zooms", fmt::format("{} to {}", layer.min_zoom, layer.max_zoom));
  const RectangleDeg& bounds = layer.bounds_deg;
  line("bounds", fmt::format("west {:.10g} south {:.10g} east {:.10g} north {:.10g} degrees",
                             bounds.west_deg, bounds.south_deg, bounds.east_deg, bounds.north_deg));
}

void print_table(const TileSetFacts& facts) {
  const auto row = [](const std::string& name, const ZoomFacts& zoom) {
    fmt::print("{:>5}{:>12}{:>16}{:>10}{:>12.1f}{:>10}\n", name, zoom.tiles, zoom.bytes,
               zoom.min_bytes, zoom.mean_bytes(), zoom.max_bytes);
  };
  fmt::print("\n zoom       tiles           bytes  smallest        mean   largest\n");
  for (const auto& [zoom, zoom_facts] : facts.zooms) row(std::to_string(zoom), zoom_facts);
  row("total", total_of(facts));
}

void print_text(const std::filesystem::path& path, const TileSetFacts& facts) {
  fmt::print("{:<13}{}\n", "tile set", printable_line(path.string()));
  if (facts.layer) print_layer(*facts.layer);
  print_table(facts);
  if (facts.complaints.empty()) return;
  fmt::print("\ncomplaints\n");
  for (const std::string& complaint : facts.complaints)
    fmt::print("  {}\n", printable_line(complaint));
}

using Json = nlohmann::ordered_json;

Json json_of(const ZoomFacts& zoom) {
  return {{"tiles", zoom.tiles},
          {"bytes", zoom.bytes},
          {"min_bytes", zoom.min_bytes},
          {"mean_bytes", zoom.mean_bytes()},
          {"max_bytes", zoom.max_bytes}};
}

Json json_of(const ParsedLayerJson& parsed) {
  const LayerJson& layer = parsed.layer;
  const RectangleDeg& bounds = layer.bounds_deg;
  return {{"name", layer.name},
          {"description", layer.description},
          {"attribution", layer.attribution},
          {"version", layer.version},
          {"format", parsed.format},
          {"scheme", parsed.scheme},
          {"projection", crs_of(layer.projection)},
          {"tiles", layer.tile_urls},
          {"extensions", layer.extensions},
          {"min_zoom", layer.min_zoom},
          {"max_zoom", layer.max_zoom},
          {"bounds_deg", {bounds.west_deg, bounds.south_deg, bounds.east_deg, bounds.north_deg}}};
}

void print_json(const std::filesystem::path& path, const TileSetFacts& facts) {
  Json document = {{"path", path.string()}, {"layer", nullptr}, {"zooms", Json::array()}};
  if (facts.layer) document["layer"] = json_of(*facts.layer);
  for (const auto& [zoom, zoom_facts] : facts.zooms) {
    Json row = {{"zoom", zoom}};
    row.update(json_of(zoom_facts));
    document["zooms"].push_back(std::move(row));
  }
  document["total"] = json_of(total_of(facts));
  document["complaints"] = facts.complaints;
  // Paths may hold bytes that are no UTF-8.
  fmt::print("{}\n", document.dump(2, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

int report_tile_set(const std::filesystem::path& path, ReportStyle style) {
  const TileSetFacts facts = facts_of(*open_tile_set(path));
  if (style == ReportStyle::kJson) {
    print_json(path, facts);
  } else {
    print_text(path, facts);
  }
  return facts.layer ? 0 : 1;
}

}  // namespace qmpipe
