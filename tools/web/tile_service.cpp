#include "tools/web/tile_service.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string_view>

#include "formats/bytes/gzip.h"
#include "formats/bytes/hash64.h"
#include "formats/tile/layer_json.h"
#include "formats/tile/tile_path.h"
#include "pipeline/verify/height_glance.h"

namespace qmpipe::web {
namespace {

using Json = nlohmann::ordered_json;

constexpr const char* kTileMediaType = "application/vnd.quantized-mesh";

std::string_view trimmed(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

template <class Visit>
void for_each_item(std::string_view list, const Visit& visit) {
  while (!list.empty()) {
    const std::size_t comma = std::min(list.find(','), list.size());
    visit(trimmed(list.substr(0, comma)));
    list.remove_prefix(std::min(comma + 1, list.size()));
  }
}

bool has_it(const std::string& if_none_match, const std::string& quoted_etag) {
  bool found = false;
  for_each_item(if_none_match, [&](std::string_view item) {
    if (item.starts_with("W/")) item.remove_prefix(2);
    found = found || item == "*" || item == quoted_etag;
  });
  return found;
}

}  // namespace

std::string etag_of(std::span<const std::uint8_t> bytes) {
  return fmt::format("{:016x}", hash64(bytes, 0));
}

bool accepts_gzip(const std::string& accept_encoding) {
  bool accepts = false;
  for_each_item(accept_encoding, [&](std::string_view item) {
    const std::size_t semicolon = std::min(item.find(';'), item.size());
    const std::string_view coding = trimmed(item.substr(0, semicolon));
    if (coding != "gzip" && coding != "x-gzip" && coding != "*") return;
    std::string_view weight = trimmed(item.substr(std::min(semicolon + 1, item.size())));
    if (weight.starts_with("q=")) weight.remove_prefix(2);
    accepts = weight.empty() || weight.find_first_not_of("0.") != std::string_view::npos;
  });
  return accepts;
}

HttpReply error_reply(int status, const std::string& message) {
  HttpReply reply = {.status = status, .media_type = "application/json", .body = {}, .headers = {}};
  reply.body = Json{{"error", message}}.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  return reply;
}

HttpReply cached_reply(const HttpRequest& request, std::string media_type, std::string body,
                       const std::string& etag) {
  const std::string quoted = "\"" + etag + "\"";
  HttpReply reply;
  reply.headers = {{"ETag", quoted}, {"Vary", "Accept-Encoding"}};
  if (has_it(request.if_none_match, quoted)) {
    reply.status = 304;
    return reply;
  }
  reply.media_type = std::move(media_type);
  reply.body = std::move(body);
  return reply;
}

TileService::TileService(std::unique_ptr<TileSet> tile_set, const std::string& name)
    : tile_set_(std::move(tile_set)), layer_(fit_layer_json(*tile_set_, name)) {
  const auto parsed = parse_layer_json(layer_.text);
  if (parsed && !parsed->layer.qmpipe_json.empty() && layer_.changes.empty()) {
    lasting_version_ = parsed->layer.version;
  }
  description_ = describe();
}

std::string TileService::describe() const {
  const auto parsed = parse_layer_json(layer_.text);
  const std::vector<TileKey>& keys = tile_set_->keys();
  Json set = {{"name", parsed ? parsed->layer.name : ""},
              {"tiles", keys.size()},
              {"min_zoom", keys.front().zoom},
              {"max_zoom", keys.back().zoom}};
  const TilingScheme scheme(parsed ? parsed->layer.projection : Projection::kGeodetic);
  if (std::all_of(keys.begin(), keys.end(), [&](const TileKey& k) { return scheme.contains(k); })) {
    const RectangleDeg box = bounds_of_deepest(keys, scheme);
    set["bounds_deg"] = {box.west_deg, box.south_deg, box.east_deg, box.north_deg};
  }
  if (const auto heights = verify::glance_at_heights(*tile_set_)) {
    set["heights_m"] = {heights->low_m, heights->high_m};
  }
  set["layer_changes"] = layer_.changes;
  return set.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

std::optional<HttpReply> TileService::answer(const HttpRequest& request) const {
  std::string_view path = request.path;
  if (!path.starts_with('/')) return std::nullopt;
  path.remove_prefix(path.starts_with("/tiles/") ? std::string_view("/tiles/").size() : 1);
  if (path == "layer.json" || path == "set.json") {
    const std::string& text = path == "layer.json" ? layer_.text : description_;
    const std::span bytes(reinterpret_cast<const std::uint8_t*>(text.data()), text.size());
    HttpReply reply = cached_reply(request, "application/json", text, etag_of(bytes));
    reply.headers.emplace_back("Cache-Control", "no-cache");
    return reply;
  }
  if (!path.ends_with(kTileExtension)) return std::nullopt;
  const std::optional<TileKey> key = parse_tile_path(std::string(path));
  if (!key || tile_file_name(*key) != path) {
    return error_reply(404, fmt::format("{} is no tile's name: ask for z/x/y.terrain", path));
  }
  return answer_tile(request, *key);
}

HttpReply TileService::answer_tile(const HttpRequest& request, const TileKey& key) const {
  const std::vector<TileKey>& keys = tile_set_->keys();
  if (!std::binary_search(keys.begin(), keys.end(), key)) {
    return error_reply(404, fmt::format("tile {} is not in the set", to_string(key)));
  }
  auto tile = tile_set_->read(key);
  if (!tile) return error_reply(500, tile.error().message);
  const bool is_packed = is_gzip(*tile);
  std::string etag = etag_of(*tile);
  const bool stays_packed = is_packed && accepts_gzip(request.accept_encoding);
  if (is_packed && !stays_packed) {
    tile = plain_tile_bytes(std::move(*tile));
    if (!tile)
      return error_reply(500, fmt::format("tile {}: {}", to_string(key), tile.error().message));
    etag += "-plain";
  }
  HttpReply reply =
      cached_reply(request, kTileMediaType, std::string(tile->begin(), tile->end()), etag);
  const bool is_lasting = !lasting_version_.empty() && request.version == lasting_version_;
  reply.headers.emplace_back("Cache-Control",
                             is_lasting ? "public, max-age=31536000, immutable" : "no-cache");
  if (stays_packed && reply.status == 200) reply.headers.emplace_back("Content-Encoding", "gzip");
  return reply;
}

}  // namespace qmpipe::web
