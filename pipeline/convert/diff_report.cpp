#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/bytes/printable.h"
#include "pipeline/common/text_table.h"
#include "pipeline/convert/diff_sets.h"

namespace qmpipe {
namespace {

using Json = nlohmann::ordered_json;

TableRow row_of(const std::string& name, const ZoomDiff& zoom) {
  return {name,
          grouped(zoom.tiles_a),
          grouped(zoom.tiles_b),
          grouped(zoom.only_in_a),
          grouped(zoom.only_in_b),
          grouped(zoom.same_bytes),
          grouped(zoom.same_unpacked),
          grouped(zoom.different),
          fmt::format("{:.4g}", zoom.largest_height_m)};
}

std::string joined_parts(const std::vector<std::string>& parts) {
  std::string text;
  for (const std::string& part : parts) text += (text.empty() ? "" : "; ") + part;
  return text;
}

std::string not_shown(std::int64_t number, std::size_t shown, const char* what) {
  const std::int64_t more = number - static_cast<std::int64_t>(shown);
  return more > 0 ? fmt::format("{} more {} not shown\n", grouped(more), what) : "";
}

std::string listed(const std::vector<TileKey>& keys, const char* set, std::int64_t number) {
  std::string text;
  for (const TileKey& key : keys) text += fmt::format("only in {} {}\n", set, to_string(key));
  return text + not_shown(number, keys.size(), fmt::format("only in {}", set).c_str());
}

std::string summary_of(const DiffReport& report) {
  if (report.is_same()) {
    return fmt::format("diff: the same, {}, {} with other compression\n",
                       counted(report.total.tiles_a, "tile"), grouped(report.total.same_unpacked));
  }
  return fmt::format(
      "diff: {} different, {} only in A, {} only in B, {} the same; {} of layer.json differ\n",
      counted(report.total.different, "tile"), grouped(report.total.only_in_a),
      grouped(report.total.only_in_b),
      grouped(report.total.same_bytes + report.total.same_unpacked),
      counted(static_cast<std::int64_t>(report.layer.size()), "value"));
}

// JSON has no infinity.
Json number_or_null(double value) { return std::isfinite(value) ? Json(value) : Json(nullptr); }

Json json_of_counts(const ZoomDiff& zoom) {
  return {{"tiles_a", zoom.tiles_a},
          {"tiles_b", zoom.tiles_b},
          {"only_in_a", zoom.only_in_a},
          {"only_in_b", zoom.only_in_b},
          {"same_bytes", zoom.same_bytes},
          {"same_unpacked", zoom.same_unpacked},
          {"different", zoom.different},
          {"undecodable", zoom.undecodable},
          {"largest_height_m", number_or_null(zoom.largest_height_m)}};
}

Json json_of_keys(const std::vector<TileKey>& keys) {
  Json list = Json::array();
  for (const TileKey& key : keys) list.push_back(to_string(key));
  return list;
}

Json json_of_tile(const TileDifference& tile) {
  return {{"tile", to_string(tile.key)},
          {"undecodable", tile.is_undecodable},
          {"posts_only_in_a", tile.mesh.posts_only_in_a},
          {"posts_only_in_b", tile.mesh.posts_only_in_b},
          {"largest_height_m", number_or_null(tile.mesh.largest_height_m)},
          {"largest_normal_deg", number_or_null(tile.mesh.largest_normal_deg)},
          {"differs", tile.parts}};
}

}  // namespace

std::string text_of(const DiffReport& report) {
  std::vector<TableRow> rows = {{"zoom", "A", "B", "only in A", "only in B", "same bytes",
                                 "same unpacked", "different", "max height m"}};
  for (const ZoomDiff& zoom : report.zooms) rows.push_back(row_of(std::to_string(zoom.zoom), zoom));
  if (report.zooms.size() > 1) rows.push_back(row_of("all", report.total));
  std::string text = table_text(rows);
  for (const LayerDifference& layer : report.layer) {
    text += fmt::format("layer.json {}: {} / {}\n", printable_line(layer.key),
                        printable_line(layer.a), printable_line(layer.b));
  }
  text += listed(report.only_in_a, "A", report.total.only_in_a);
  text += listed(report.only_in_b, "B", report.total.only_in_b);
  for (const TileDifference& tile : report.worst) {
    text += fmt::format("different {}: {}\n", to_string(tile.key),
                        printable_line(joined_parts(tile.parts)));
  }
  text += not_shown(report.total.different, report.worst.size(), "different");
  return text + summary_of(report);
}

std::string json_of(const DiffReport& report) {
  Json layer = Json::array();
  for (const LayerDifference& difference : report.layer) {
    layer.push_back({{"key", difference.key}, {"a", difference.a}, {"b", difference.b}});
  }
  Json zooms = Json::array();
  for (const ZoomDiff& zoom : report.zooms) {
    Json counts = {{"zoom", zoom.zoom}};
    counts.update(json_of_counts(zoom));
    zooms.push_back(counts);
  }
  Json tiles = Json::array();
  for (const TileDifference& tile : report.worst) tiles.push_back(json_of_tile(tile));
  const Json json = {{"same", report.is_same()},
                     {"total", json_of_counts(report.total)},
                     {"zooms", zooms},
                     {"layer", layer},
                     {"only_in_a", json_of_keys(report.only_in_a)},
                     {"only_in_b", json_of_keys(report.only_in_b)},
                     {"worst", tiles}};
  // Texts may quote bytes of a damaged layer.json.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace qmpipe
