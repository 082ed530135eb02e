#include "pipeline/web_check/check_layer.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>

#include "formats/bytes/letter_case.h"
#include "pipeline/web_check/check_available.h"
#include "pipeline/web_check/http_answer.h"
#include "scheduler/check.h"

namespace qmpipe::web_check {
namespace {

// Those that mean something in a layer.json, in TileJSON, or to qmpipe.
constexpr std::array kKnownKeys = {"attribution", "available",  "basename",
                                   "bounds",      "center",     "data",
                                   "description", "extensions", "format",
                                   "grids",       "id",         "legend",
                                   "license",     "maxzoom",    "minzoom",
                                   "name",        "parentUrl",  "profile",
                                   "projection",  "qmpipe",     "scheme",
                                   "template",    "tilejson",   "tiles",
                                   "type",        "version",    "metadataAvailability"};

// Letters to insert, remove or replace, at most `limit` + 1.
std::size_t edit_distance(const std::string& a, const std::string& b, std::size_t limit) {
  if (std::max(a.size(), b.size()) - std::min(a.size(), b.size()) > limit) return limit + 1;
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t replaced = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({replaced, row[j] + 1, row[j - 1] + 1});
    }
  }
  return std::min(row.back(), limit + 1);
}

class LayerCheck {
 public:
  LayerCheck(ParsedLayerJson parsed, const nlohmann::json& root, const WebAddress& url,
             CheckLog& log)
      : root_(root), url_(url), log_(log) {
    layer_.scheme = TilingScheme(parsed.layer.projection);
    layer_.parsed = std::move(parsed);
    layer_.has_parent = root.contains("parentUrl");
  }

  ServedLayer run() {
    check_keys();
    check_format();
    check_scheme();
    check_urls();
    check_extensions();
    check_zooms();
    if (layer_.has_parent) add(CheckKind::kParentNotChecked, parent_text());
    return std::move(layer_);
  }

 private:
  const LayerJson& json() const { return layer_.parsed.layer; }

  void add(CheckKind kind, const std::string& text) {
    log_.add(kind, CheckSubject::kLayer, url_.text(), text);
  }
  void give_up(CheckKind kind, const std::string& text) {
    add(kind, text);
    layer_.is_usable = false;
  }

  std::string parent_text() const {
    const nlohmann::json& parent = root_.at("parentUrl");
    return fmt::format("\"parentUrl\" is {}",
                       parent.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace));
  }

  void check_keys() {
    for (const auto& item : root_.items()) {
      const std::string& key = item.key();
      if (std::find(kKnownKeys.begin(), kKnownKeys.end(), key) != kKnownKeys.end()) continue;
      for (const char* known : kKnownKeys) {
        if (root_.contains(known)) continue;
        const std::string lower = lower_case(known);
        const std::size_t limit = lower.size() > 5 ? 2 : 1;
        if (edit_distance(lower_case(key), lower, limit) > limit) continue;
        add(CheckKind::kMisspeltKey,
            fmt::format("\"{}\" is no key of layer.json; \"{}\" is", key, known));
        break;
      }
    }
  }

  void check_format() {
    const std::string& format = layer_.parsed.format;
    if (format.starts_with("quantized-mesh-1.")) return;
    give_up(CheckKind::kFormat,
            format.empty() ? "\"format\" is missing" : fmt::format("\"format\" is \"{}\"", format));
  }

  // Not parsed.scheme: that one takes "schema" for "scheme", which clients do not.
  void check_scheme() {
    if (!root_.contains("scheme")) return;
    const std::string& scheme = layer_.parsed.scheme;
    if (scheme == "slippyMap") {
      layer_.row_order = RowOrder::kXyz;
      add(CheckKind::kSchemeNotTms,
          "\"scheme\" is \"slippyMap\"; the specification knows \"tms\" only");
    } else if (scheme != "tms") {
      give_up(CheckKind::kScheme, fmt::format("\"scheme\" is \"{}\"", scheme));
    }
  }

  void check_urls() {
    if (json().tile_urls.empty()) {
      return give_up(CheckKind::kNoTileUrls, "\"tiles\" is missing or empty");
    }
    for (const std::string& tile_url : json().tile_urls) check_url(tile_url);
  }

  void check_url(const std::string& tile_url) {
    for (const char* name : {"{z}", "{x}", "{y}"}) {
      if (tile_url.find(name) == std::string::npos) {
        return give_up(CheckKind::kTileUrl,
                       fmt::format("the template \"{}\" in \"tiles\" has no {}", tile_url, name));
      }
    }
    if (tile_url.find("{version}") != std::string::npos && json().version.empty()) {
      add(CheckKind::kNoVersion,
          fmt::format("the template \"{}\" in \"tiles\" has {{version}}, but "
                      "there is no \"version\"",
                      tile_url));
    }
    const TemplateValues zeros = {.key = {}, .version = "1"};
    const std::string filled = fill_template(tile_url, zeros);
    if (filled.find("%7B") != std::string::npos) {
      add(CheckKind::kTileUrl,
          fmt::format("the template \"{}\" in \"tiles\" has a placeholder that "
                      "is none of {{z}}, {{x}}, {{y}}, {{version}}",
                      tile_url));
    }
    const Result<WebAddress> address = resolve(folder_of(url_), filled);
    if (!address) {
      return give_up(CheckKind::kTileUrl,
                     fmt::format("the template \"{}\" in \"tiles\" leads to no "
                                 "address: {}",
                                 tile_url, address.error().message));
    }
    if (url_.scheme == "https" && address->scheme == "http" && !address->is_loopback()) {
      add(CheckKind::kMixedContent,
          fmt::format("layer.json came over https, the template \"{}\" in \"tiles\" leads to http",
                      tile_url));
    }
  }

  void check_extensions() {
    for (const std::string& name : json().extensions) {
      if (name == "octvertexnormals" || name == "vertexnormals" || name == "watermask" ||
          name == "metadata") {
        continue;
      }
      add(CheckKind::kUnknownExtension, fmt::format("\"extensions\" holds \"{}\"", name));
    }
  }

  void check_zooms() {
    if (!layer_.parsed.has_max_zoom) add(CheckKind::kNoMaxZoom, "\"maxzoom\" is missing");
    const std::optional<std::int32_t>& levels = layer_.parsed.metadata_availability;
    const AvailableKey key =
        root_.contains("available") ? AvailableKey::kPresent : AvailableKey::kAbsent;
    if (!levels) return check_available(layer_, key, url_, log_);
    if (*levels < 1) {
      give_up(CheckKind::kMetadataLevels, fmt::format("\"metadataAvailability\" is {}", *levels));
    }
    if (key == AvailableKey::kPresent) {
      add(CheckKind::kAvailableIgnored,
          "there are both \"available\" and \"metadataAvailability\"");
    }
  }

  const nlohmann::json& root_;
  const WebAddress& url_;
  CheckLog& log_;
  ServedLayer layer_;
};

}  // namespace

bool ServedLayer::has_extension(const std::string& name) const {
  const std::vector<std::string>& names = parsed.layer.extensions;
  return std::find(names.begin(), names.end(), name) != names.end();
}

bool ServedLayer::lists(const TileKey& key) const {
  if (static_cast<std::size_t>(key.zoom) >= available.size()) return false;
  const std::vector<TileRange>& ranges = available[static_cast<std::size_t>(key.zoom)];
  return std::any_of(ranges.begin(), ranges.end(), [&key](const TileRange& range) {
    return range.start_x <= key.x && key.x <= range.end_x && range.start_y <= key.y &&
           key.y <= range.end_y;
  });
}

ServedLayer check_layer_text(const std::string& text, const WebAddress& url, CheckLog& log) {
  Result<ParsedLayerJson> parsed = parse_layer_json(text);
  if (!parsed) {
    log.add(CheckKind::kLayerUnreadable, CheckSubject::kLayer, url.text(), parsed.error().message);
    ServedLayer unusable;
    unusable.is_usable = false;
    return unusable;
  }
  // parse_layer_json() took it, so it is a JSON object of bounded depth.
  const nlohmann::json root = nlohmann::json::parse(text, nullptr, false);
  QMPIPE_CHECK(root.is_object());
  return LayerCheck(std::move(*parsed), root, url, log).run();
}

Result<WebAddress> tile_address(const ServedLayer& layer, const WebAddress& folder,
                                const TileKey& key) {
  QMPIPE_CHECK(layer.is_usable && layer.scheme.contains(key));
  const std::vector<std::string>& templates = layer.parsed.layer.tile_urls;
  const auto sum = static_cast<std::size_t>(key.x) + static_cast<std::size_t>(key.y) +
                   static_cast<std::size_t>(key.zoom);
  TileKey written = key;
  if (layer.row_order == RowOrder::kXyz) {
    written.y = layer.scheme.rows(key.zoom) - 1 - key.y;
  }
  return resolve(folder, fill_template(templates[sum % templates.size()],
                                       {.key = written, .version = layer.parsed.layer.version}));
}

}  // namespace qmpipe::web_check
