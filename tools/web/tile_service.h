// What a web server answers to a request for a part of a tile set: without sockets, so whatever a
// request says, the answer is one of a few.
//
// Addresses, below / or /tiles/:
//   layer.json            as fit_layer_json() gives it
//   {z}/{x}/{y}.terrain   application/vnd.quantized-mesh; with Content-Encoding: gzip as it is
//                         stored, plain where the client takes no gzip
//   set.json              what the viewer shows of the set: name, tiles, zooms, bounds_deg and
//                         heights_m of its deepest tiles, and what fit_layer_json() changed
// Every answer allows any origin. Tiles and layer.json have an ETag; a tile asked for with the
// version of a set made by qmpipe may be kept for ever, since that version changes with any tile.
#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "formats/tile/tile_set.h"
#include "formats/tile_sets/fit_layer_json.h"

namespace qmpipe::web {

struct HttpRequest {
  std::string path;  // percent-decoded, without the query
  std::string version;
  std::string if_none_match;
  std::string accept_encoding;
};

struct HttpReply {
  int status = 200;
  std::string media_type;
  std::string body;
  std::vector<std::pair<std::string, std::string>> headers;
};

// By its Accept-Encoding header (RFC 9110, section 12.5.3).
bool accepts_gzip(const std::string& accept_encoding);

// {"error": "..."} with that status.
HttpReply error_reply(int status, const std::string& message);

// Of a body, without quotes.
std::string etag_of(std::span<const std::uint8_t> bytes);

// 200 with the body, or 304 without it when the client has it; `etag` without quotes.
HttpReply cached_reply(const HttpRequest& request, std::string media_type, std::string body,
                       const std::string& etag);

// const use is safe from several threads.
class TileService {
 public:
  // `name`: for a set without a layer.json. REQUIRES: a set with tiles.
  TileService(std::unique_ptr<TileSet> tile_set, const std::string& name);

  // Nothing when the path names no part of a tile set.
  std::optional<HttpReply> answer(const HttpRequest& request) const;

  std::int64_t tiles() const { return static_cast<std::int64_t>(tile_set_->keys().size()); }
  std::int32_t deepest_zoom() const { return tile_set_->keys().back().zoom; }
  const std::vector<std::string>& layer_changes() const { return layer_.changes; }

 private:
  HttpReply answer_tile(const HttpRequest& request, const TileKey& key) const;
  std::string describe() const;

  std::unique_ptr<TileSet> tile_set_;
  FittedLayer layer_;
  // The version that stands for these very bytes; empty in other programs' sets.
  std::string lasting_version_;
  std::string description_;  // set.json
};

}  // namespace qmpipe::web
