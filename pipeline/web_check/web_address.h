// Addresses of http and https, as far as `check` needs them: taken apart, put together, and a tile's
// made from the templates of layer.json as CesiumJS makes it.
#pragma once

#include <string>
#include <string_view>

#include "formats/bytes/result.h"
#include "scheduler/tile_key.h"

namespace qmpipe::web_check {

struct WebAddress {
  std::string scheme;     // "http" or "https"
  std::string authority;  // "localhost:8080", in lower case
  std::string path;       // begins with '/'
  std::string query;      // without '?'; may be empty

  std::string text() const;
  // "https://host", without the scheme's own port.
  std::string origin() const;
  // The machine itself, which browsers trust without https.
  bool is_loopback() const;
};

// Refuses what is no http or https address, has no host, or holds blanks or control characters.
// A fragment is dropped.
Result<WebAddress> parse_web_address(std::string_view text);

// The folder of a tile set, its path ending in '/', from an address of it or of its layer.json.
WebAddress folder_of(WebAddress address);

// `reference` as seen from `folder`; the folder's query (a token, say) is kept, as CesiumJS does.
// Refuses what leads to another scheme than http and https. REQUIRES: the folder's path ends in '/'.
Result<WebAddress> resolve(const WebAddress& folder, std::string_view reference);

// A text with addresses in it, for messages: "https://user:pass@host" as "https://***@host".
std::string without_credentials(std::string_view text);

// What `{z}`, `{x}`, `{y}` and `{version}` stand for; an empty version leaves its placeholder.
struct TemplateValues {
  TileKey key;  // y as it is to be written
  std::string version;
};
// Unknown placeholders stay, with their braces percent-encoded, which is how browsers send them.
std::string fill_template(std::string_view url_template, const TemplateValues& values);

}  // namespace qmpipe::web_check
