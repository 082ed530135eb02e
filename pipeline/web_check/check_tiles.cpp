#include "pipeline/web_check/check_tiles.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <set>

#include "formats/tile/tile_set.h"
#include "pipeline/web_check/check_sample.h"
#include "scheduler/check.h"
#include "scheduler/elementary.h"
#include "stages/surface/geodesy.h"

namespace qmpipe::web_check {
namespace {

constexpr int kMostUnanswered = 3;
// Missing tiles that are looked for under the name of the mirrored row, before that is given up.
constexpr int kMostVainMirroredNames = 3;

// What CesiumJS asks for: what it wants and the layer offers.
std::string accept_header(const ServedLayer& layer) {
  std::vector<std::string> offered;
  for (const char* name : {"octvertexnormals", "watermask", "metadata"}) {
    if (layer.has_extension(name)) offered.emplace_back(name);
  }
  return fmt::format("application/vnd.quantized-mesh{}{},application/octet-stream;q=0.9,*/*;q=0.01",
                     offered.empty() ? "" : ";extensions=", fmt::join(offered, "-"));
}

HttpQuestion request_of(const AskingPage& page, const WebAddress& address,
                        const std::string& accept) {
  // Nothing but gzip is offered, so that whatever comes can be read.
  HttpQuestion request = {.method = HttpMethod::kGet,
                          .url = address.text(),
                          .headers = {{.name = "Accept", .value = accept},
                                      {.name = "Accept-Encoding", .value = "gzip"}},
                          .limit_bytes = 0};
  if (page.origin != address.origin()) {
    request.headers.push_back({.name = "Origin", .value = page.origin});
  }
  return request;
}

// Roughly where on the globe, good enough to recognise a place.
std::string place_text(const Vec3& point_ecef) {
  return fmt::format(
      "{:.2f}, {:.2f} degrees (longitude, latitude)", atan2_deg(point_ecef[1], point_ecef[0]),
      atan2_deg(point_ecef[2],
                std::sqrt(point_ecef[0] * point_ecef[0] + point_ecef[1] * point_ecef[1])));
}

bool can_be_cached(const HttpAnswer& answer) {
  return answer.header("cache-control") || answer.header("expires") || answer.header("etag") ||
         answer.header("last-modified");
}

}  // namespace

Result<HttpAnswer> Asker::get(const WebAddress& address, const std::string& accept,
                              std::size_t limit_bytes) const {
  HttpQuestion request = request_of(page, address, accept);
  request.limit_bytes = limit_bytes;
  return fetch(request);
}

Result<HttpAnswer> Asker::head(const WebAddress& address, const std::string& accept) const {
  HttpQuestion request = request_of(page, address, accept);
  request.method = HttpMethod::kHead;
  return fetch(request);
}

TileCheck::TileCheck(const ServedLayer& layer, const WebAddress& folder, const Asker& asker,
                     CheckLog& log)
    : layer_(layer), folder_(folder), asker_(asker), log_(log), accept_(accept_header(layer)) {
  QMPIPE_CHECK(layer.is_usable);
}

void TileCheck::add(CheckKind kind, const std::string& url, const std::string& text) {
  log_.add(kind, CheckSubject::kTile, url, text);
}

bool TileCheck::has_given_up() const { return unanswered_ >= kMostUnanswered; }

void TileCheck::ask_for_sample(std::size_t limit) {
  // Roots that are not listed have been told; those of a layer above another may be there.
  std::vector<TileKey> roots = layer_.scheme.roots();
  std::erase_if(roots, [this](const TileKey& root) { return !layer_.lists(root); });
  for (const TileKey& key : sample_tiles(layer_.available, roots, limit)) {
    if (has_given_up()) return;
    if (log_.has(CheckKind::kManyRanges)) look_for_unlisted_parents(key);
    ask_for(key);
  }
}

void TileCheck::look_for_unlisted_parents(const TileKey& key) {
  for (TileKey child = key; child.zoom > 1; child = parent_of(child)) {
    if (layer_.lists(parent_of(child))) continue;
    add(CheckKind::kAvailableHole, tile_address(layer_, folder_, key).value().text(),
        fmt::format("{} is listed, {} above it is not", to_string(key),
                    to_string(parent_of(child))));
    return;
  }
}

void TileCheck::walk_down(std::size_t limit) {
  const std::vector<TileKey> roots = layer_.scheme.roots();
  std::deque<TileKey> to_ask(roots.begin(), roots.end());
  std::set<TileKey> known(roots.begin(), roots.end());
  const std::int32_t levels = *layer_.parsed.metadata_availability;
  while (!to_ask.empty() && asked_ < static_cast<std::int64_t>(limit) && !has_given_up()) {
    const TileKey key = to_ask.front();
    to_ask.pop_front();
    const std::optional<QuantizedMesh> mesh = ask_for(key);
    if (!mesh || !mesh->metadata_json) continue;
    const auto below = ranges_below(key, *mesh->metadata_json);
    for (std::size_t k = 0; k < below.size(); ++k) {
      const std::int32_t zoom = key.zoom + 1 + static_cast<std::int32_t>(k);
      const std::vector<TileKey> telling = telling_tiles(below[k], zoom);
      for (std::size_t i = 0; i < telling.size(); ++i) {
        if (!known.insert(telling[i]).second) continue;
        // The next one that knows what lies below it comes first, so that the walk gets down.
        if (i == 0 && zoom % levels == 0) {
          to_ask.push_front(telling[i]);
        } else {
          to_ask.push_back(telling[i]);
        }
      }
    }
  }
}

std::vector<std::vector<TileRange>> TileCheck::ranges_below(const TileKey& key,
                                                            const std::string& json) {
  // An empty text says that there is nothing below.
  if (json.empty()) return {};
  const std::string url = tile_address(layer_, folder_, key).value().text();
  // The same key with the same ranges as in layer.json; all others of that are optional.
  const Result<ParsedLayerJson> parsed = parse_layer_json(json);
  if (!parsed) {
    add(CheckKind::kMetadataUnreadable, url, "the metadata extension: " + parsed.error().message);
    return {};
  }
  std::vector<std::vector<TileRange>> below = parsed->layer.available;
  below.resize(std::min<std::size_t>(below.size(), static_cast<std::size_t>(kMaxZoom - key.zoom)));
  for (std::size_t k = 0; k < below.size(); ++k) {
    const std::int32_t zoom = key.zoom + 1 + static_cast<std::int32_t>(k);
    const auto bad = std::erase_if(below[k], [&](const TileRange& range) {
      return range.start_x > range.end_x || range.start_y > range.end_y ||
             !layer_.scheme.contains({.zoom = zoom, .x = range.start_x, .y = range.start_y}) ||
             !layer_.scheme.contains({.zoom = zoom, .x = range.end_x, .y = range.end_y});
    });
    if (bad == 0) continue;
    add(CheckKind::kMetadataUnreadable, url,
        fmt::format("the metadata extension: {} ranges of zoom {} are reversed or outside the "
                    "tiling scheme",
                    bad, zoom));
  }
  return below;
}

std::optional<QuantizedMesh> TileCheck::ask_for(const TileKey& key) {
  const WebAddress address = tile_address(layer_, folder_, key).value();
  ++asked_;
  const Result<HttpAnswer> answer = asker_.get(address, accept_, kLargestTileBytes);
  if (!answer) {
    ++unanswered_;
    add(CheckKind::kTileNoAnswer, address.text(),
        answer.error().message +
            (has_given_up() ? "; no more tiles are asked for after this" : ""));
    return std::nullopt;
  }
  if (answer->redirects > 0) {
    add(CheckKind::kTileRedirect, address.text(), fmt::format("redirected to {}", answer->url));
  }
  if (answer->status != 200) {
    look_at_missing(key, *answer);
    return std::nullopt;
  }
  const std::int64_t faulty_before = log_.faulty_answers();
  check_cors(asker_.page, address, *answer, CheckSubject::kTile, log_);
  std::optional<QuantizedMesh> mesh = look_at_tile(key, *answer);
  if (log_.faulty_answers() == faulty_before) ++sound_;
  return mesh;
}

std::optional<QuantizedMesh> TileCheck::look_at_tile(const TileKey& key, const HttpAnswer& answer) {
  std::optional<QuantizedMesh> mesh = check_tile_body(layer_, key, answer, log_);
  if (!mesh) return mesh;
  ++read_;
  if (!first_read_) first_read_ = key;
  deepest_zoom_ = std::max(deepest_zoom_, key.zoom);
  has_water_mask_ = has_water_mask_ || !mesh->water_mask.empty();
  look_at_place(key, *mesh, answer.url);
  if (!can_be_cached(answer)) {
    add(CheckKind::kNoCaching, answer.url,
        "there is none of Cache-Control, Expires, ETag and Last-Modified");
  }
  return mesh;
}

void TileCheck::look_at_missing(const TileKey& key, const HttpAnswer& answer) {
  const std::string text =
      fmt::format("{} for {}, which is listed", status_text(answer), to_string(key));
  if (key.zoom == 0) {
    add(CheckKind::kRootMissing, answer.url, text);
  } else if (lies_at_mirrored_name(key)) {
    add_flipped(answer.url, text);
  } else {
    add(CheckKind::kTileMissing, answer.url, text);
  }
}

void TileCheck::add_flipped(const std::string& url, const std::string& text) {
  const bool says_south = layer_.row_order == RowOrder::kTms;
  add(CheckKind::kRowsFlipped, url,
      fmt::format("rows are counted from the {}, but layer.json says that they are counted from "
                  "the {}: {}",
                  says_south ? "north" : "south", says_south ? "south" : "north", text));
}

bool TileCheck::lies_at_mirrored_name(const TileKey& key) {
  if (vain_mirrored_names_ >= kMostVainMirroredNames) return false;
  const WebAddress address = tile_address(layer_, folder_, mirrored(layer_.scheme, key)).value();
  const Result<HttpAnswer> answer = asker_.get(address, accept_, kLargestTileBytes);
  if (answer && answer->status == 200) {
    CheckLog unused;
    const auto mesh = check_tile_body(layer_, key, *answer, unused);
    if (mesh && place_of_tile(layer_.scheme, key, mesh->header) == Whereabouts::kHere) return true;
  }
  ++vain_mirrored_names_;
  return false;
}

void TileCheck::look_at_place(const TileKey& key, const QuantizedMesh& mesh,
                              const std::string& url) {
  // The spheres of both roots are almost the globe.
  if (key.zoom == 0) return;
  const std::string text = fmt::format("the bounding sphere of {} is around {}", to_string(key),
                                       place_text(mesh.header.sphere_centre_ecef_m));
  switch (place_of_tile(layer_.scheme, key, mesh.header)) {
    case Whereabouts::kHere:
      return;
    case Whereabouts::kMirroredRow:
      return add_flipped(url, text);
    case Whereabouts::kElsewhere:
      return add(CheckKind::kTileMisplaced, url, text);
  }
}

void TileCheck::ask_for_unlisted() {
  if (has_given_up()) return;
  std::int32_t zoom = static_cast<std::int32_t>(layer_.available.size()) - 1;
  while (layer_.available[static_cast<std::size_t>(zoom)].empty()) --zoom;
  if (zoom == kMaxZoom) return;
  const TileRange& range = layer_.available[static_cast<std::size_t>(zoom)].front();
  const TileKey child = {.zoom = zoom + 1, .x = 2 * range.start_x, .y = 2 * range.start_y};
  const WebAddress address = tile_address(layer_, folder_, child).value();
  const Result<HttpAnswer> answer = asker_.get(address, accept_, kLargestTileBytes);
  if (!answer || answer->status != 200) return;
  CheckLog unused;
  const bool is_tile = check_tile_body(layer_, child, *answer, unused).has_value();
  add(is_tile ? CheckKind::kUnlistedTile : CheckKind::kSoft404, answer->url,
      is_tile ? fmt::format("{} is served, but not listed", to_string(child))
              : fmt::format("the server answers 200 for {}, which is not listed, with something "
                            "that is no tile",
                            to_string(child)));
}

void TileCheck::ask_for_head() {
  if (has_given_up() || !first_read_) return;
  const WebAddress address = tile_address(layer_, folder_, *first_read_).value();
  const Result<HttpAnswer> answer = asker_.head(address, accept_);
  if (answer && answer->status == 200) return;
  add(CheckKind::kHeadRefused, address.text(),
      "to HEAD " +
          (answer ? status_text(*answer) : "there is no answer: " + answer.error().message));
}

}  // namespace qmpipe::web_check
