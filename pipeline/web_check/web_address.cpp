#include "pipeline/web_check/web_address.h"

#include <fmt/format.h>

#include <algorithm>

#include "formats/bytes/letter_case.h"
#include "pipeline/web_check/http_answer.h"
#include "scheduler/check.h"

namespace qmpipe::web_check {
namespace {

bool is_printable(std::string_view text) {
  return std::all_of(text.begin(), text.end(),
                     [](unsigned char c) { return c > 0x20 && c != 0x7F; });
}

// As JavaScript's encodeURIComponent.
std::string percent_encoded(std::string_view text) {
  constexpr std::string_view kKept =
      "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789-_.!~*'()";
  std::string encoded;
  for (const char c : text) {
    if (kKept.find(c) != std::string_view::npos) {
      encoded += c;
    } else {
      encoded += fmt::format("%{:02X}", static_cast<unsigned char>(c));
    }
  }
  return encoded;
}

std::string without_fragment(std::string_view text) {
  return std::string(text.substr(0, text.find('#')));
}

// "host" of "user@host:8080", "[::1]" of "[::1]:8080".
std::string_view host_of(std::string_view authority) {
  const std::size_t at = authority.rfind('@');
  if (at != std::string_view::npos) authority.remove_prefix(at + 1);
  const std::size_t bracket = authority.rfind(']');
  const std::size_t colon = authority.rfind(':');
  const bool has_port =
      colon != std::string_view::npos && (bracket == std::string_view::npos || colon > bracket);
  return has_port ? authority.substr(0, colon) : authority;
}

void append_query(std::string& query, const std::string& more) {
  if (more.empty()) return;
  query += query.empty() ? more : "&" + more;
}

}  // namespace

std::string WebAddress::text() const {
  return scheme + "://" + authority + path + (query.empty() ? "" : "?" + query);
}

std::string WebAddress::origin() const {
  std::string host = authority.substr(authority.rfind('@') + 1);
  const std::string own_port = scheme == "https" ? ":443" : ":80";
  if (host.ends_with(own_port)) host.erase(host.size() - own_port.size());
  return scheme + "://" + host;
}

bool WebAddress::is_loopback() const {
  const std::string_view host = host_of(authority);
  return host == "localhost" || host.ends_with(".localhost") || host.starts_with("127.") ||
         host == "[::1]";
}

Result<WebAddress> parse_web_address(std::string_view text) {
  const std::string whole = without_fragment(text);
  if (!is_printable(whole)) {
    return Error{fmt::format("\"{}\" holds blanks or control characters", text)};
  }
  const std::size_t colon = whole.find("://");
  WebAddress address;
  address.scheme = lower_case(whole.substr(0, colon));
  if (colon == std::string::npos || (address.scheme != "http" && address.scheme != "https")) {
    return Error{fmt::format("\"{}\" is no address that begins with http:// or https://", text)};
  }
  const std::string rest = whole.substr(colon + 3);
  const std::size_t authority_end = std::min(rest.find_first_of("/?"), rest.size());
  address.authority = lower_case(rest.substr(0, authority_end));
  if (host_of(address.authority).empty()) return Error{fmt::format("\"{}\" has no host", text)};
  const std::size_t query_at = rest.find('?');
  const std::size_t path_end = std::min(query_at, rest.size());
  address.path = rest.substr(authority_end, path_end - authority_end);
  if (address.path.empty()) address.path.push_back('/');
  if (query_at != std::string::npos) address.query = rest.substr(query_at + 1);
  return address;
}

WebAddress folder_of(WebAddress address) {
  constexpr std::string_view kLayer = "/layer.json";
  if (address.path.ends_with(kLayer)) address.path.erase(address.path.size() - kLayer.size() + 1);
  if (!address.path.ends_with('/')) address.path += '/';
  return address;
}

Result<WebAddress> resolve(const WebAddress& folder, std::string_view reference) {
  QMPIPE_CHECK(folder.path.ends_with('/'));
  const std::string text = without_fragment(reference);
  // A scheme ends at the first colon, before any slash.
  const std::size_t colon = text.find(':');
  const bool has_scheme = colon != std::string::npos && colon < text.find_first_of("/?");
  if (has_scheme || text.starts_with("//")) {
    Result<WebAddress> absolute = parse_web_address(has_scheme ? text : folder.scheme + ":" + text);
    if (absolute) append_query(absolute->query, folder.query);
    return absolute;
  }
  const std::string base = folder.scheme + "://" + folder.authority;
  Result<WebAddress> resolved =
      parse_web_address(text.starts_with('/') ? base + text : base + folder.path + text);
  if (resolved) append_query(resolved->query, folder.query);
  return resolved;
}

std::string without_credentials(std::string_view text) {
  constexpr std::string_view kSeparators = " \t\r\n/\\\"'`<>";
  std::string shown;
  while (!text.empty()) {
    const std::size_t end = std::min(text.find_first_of(kSeparators), text.size());
    std::string_view word = text.substr(0, end);
    const std::size_t at = word.rfind('@');
    // "user:pass@host" is a secret without a scheme before it as well.
    if (at != std::string_view::npos &&
        (shown.ends_with("//") || word.substr(0, at).find(':') != std::string_view::npos)) {
      shown += "***";
      word.remove_prefix(at);
    }
    shown += word;
    text.remove_prefix(end);
    if (text.empty()) break;
    shown += text.front();
    text.remove_prefix(1);
  }
  return shown;
}

std::string fill_template(std::string_view url_template, const TemplateValues& values) {
  std::string text;
  while (!url_template.empty()) {
    const std::size_t open = url_template.find('{');
    text += url_template.substr(0, open);
    if (open == std::string_view::npos) break;
    url_template.remove_prefix(open + 1);
    const std::size_t close = url_template.find('}');
    if (close == std::string_view::npos) {
      text += "%7B";
      continue;
    }
    const std::string_view name = url_template.substr(0, close);
    if (name == "z") {
      text += std::to_string(values.key.zoom);
    } else if (name == "x") {
      text += std::to_string(values.key.x);
    } else if (name == "y") {
      text += std::to_string(values.key.y);
    } else if (name == "version" && !values.version.empty()) {
      text += percent_encoded(values.version);
    } else {
      text += fmt::format("%7B{}%7D", name);
    }
    url_template.remove_prefix(close + 1);
  }
  return text;
}

}  // namespace qmpipe::web_check
