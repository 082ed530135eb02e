#include "pipeline/web_check/check_url.h"

#include <fmt/format.h>

#include "formats/bytes/errors.h"
#include "pipeline/web_check/check_answer.h"
#include "pipeline/web_check/check_layer.h"
#include "pipeline/web_check/check_tiles.h"
#include "pipeline/web_check/web_address.h"
#include "scheduler/check.h"

namespace qmpipe::web_check {
namespace {

constexpr std::size_t kLargestLayerBytes = std::size_t{64} << 20U;
// A name that no host has (RFC 2606).
constexpr const char* kSomeOtherSite = "https://viewer.example";

WebAddress understood(const char* what, const std::string& text) {
  Result<WebAddress> address = parse_web_address(text);
  if (!address) {
    throw UsageError(fmt::format("{}: {}; give it as in https://host/folder/", what,
                                 without_credentials(address.error().message)));
  }
  return std::move(*address);
}

AskingPage asking_page(const std::string& origin) {
  if (origin.empty()) return {.origin = kSomeOtherSite, .is_stated = false};
  return {.origin = understood("--origin", origin).origin(), .is_stated = true};
}

class UrlCheck {
 public:
  UrlCheck(const std::string& address, const CheckOptions& options, const Fetch& fetch)
      : folder_(folder_of(understood("URL", address))),
        layer_address_(folder_),
        options_(options),
        asker_({.page = asking_page(options.origin), .fetch = fetch}) {
    layer_address_.path += "layer.json";
    report_.layer_url = without_credentials(layer_address_.text());
  }

  CheckReport run() {
    const std::optional<std::string> text = ask_for_layer();
    if (text) {
      const ServedLayer layer = check_layer_text(*text, layer_address_, log_);
      if (layer.is_usable) ask_for_tiles(layer);
    }
    report_.findings = log_.sorted();
    return std::move(report_);
  }

 private:
  void add(CheckKind kind, const std::string& text) {
    log_.add(kind, CheckSubject::kLayer, layer_address_.text(), text);
  }

  std::optional<std::string> ask_for_layer() {
    const Result<HttpAnswer> answer = asker_.get(layer_address_, "*/*", kLargestLayerBytes);
    if (!answer) {
      add(CheckKind::kNoAnswer, answer.error().message);
      return std::nullopt;
    }
    report_.is_answered = true;
    check_scheme(*answer);
    if (answer->status != 200) {
      const bool is_missing = answer->status == 404 || answer->status == 410;
      add(is_missing ? CheckKind::kLayerMissing : CheckKind::kLayerStatus, status_text(*answer));
      return std::nullopt;
    }
    check_cors(asker_.page, layer_address_, *answer, CheckSubject::kLayer, log_);
    const auto body = plain_body(*answer, CheckSubject::kLayer, log_);
    if (!body) return std::nullopt;
    if (is_html(*body)) {
      add(CheckKind::kLayerHtml, "the server answers 200 with a web page");
      return std::nullopt;
    }
    return std::string(body->begin(), body->end());
  }

  void check_scheme(const HttpAnswer& answer) {
    const Result<WebAddress> address = parse_web_address(answer.url);
    if (!address || address->scheme == "https" || address->is_loopback()) return;
    if (!asker_.page.is_stated) {
      add(CheckKind::kHttpOnly, "the set is served over http");
    } else if (asker_.page.origin.starts_with("https:")) {
      add(CheckKind::kMixedContent, fmt::format("the set is served over http, the page {} over "
                                                "https",
                                                asker_.page.origin));
    }
  }

  void ask_for_tiles(const ServedLayer& layer) {
    TileCheck tiles(layer, folder_, asker_, log_);
    if (layer.parsed.metadata_availability) {
      tiles.walk_down(options_.most_tiles);
    } else {
      tiles.ask_for_sample(options_.most_tiles);
      tiles.ask_for_unlisted();
    }
    tiles.ask_for_head();
    if (tiles.read() > 0 && !tiles.has_water_mask() && layer.has_extension("watermask")) {
      add(CheckKind::kWaterMaskAbsent,
          fmt::format("\"extensions\" lists watermask, none of {} tiles carries one",
                      tiles.read()));
    }
    report_.tiles_asked = tiles.asked();
    report_.tiles_sound = tiles.sound();
    report_.deepest_zoom = tiles.deepest_zoom();
  }

  WebAddress folder_;
  WebAddress layer_address_;
  CheckOptions options_;
  Asker asker_;
  CheckLog log_;
  CheckReport report_;
};

}  // namespace

CheckReport check_url(const std::string& address, const CheckOptions& options, const Fetch& fetch) {
  QMPIPE_CHECK(options.most_tiles >= 1);
  return UrlCheck(address, options, fetch).run();
}

}  // namespace qmpipe::web_check
