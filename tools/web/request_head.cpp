#include "tools/web/request_head.h"

#include <fmt/format.h>

#include <algorithm>
#include <optional>

#include "formats/bytes/letter_case.h"
#include "pipeline/web_check/http_answer.h"
#include "scheduler/check.h"

namespace qmpipe::web {
namespace {

// RFC 9110, section 5.6.2.
bool is_token(std::string_view text) {
  constexpr std::string_view kMarks = "!#$%&'*+-.^_`|~";
  return !text.empty() && std::all_of(text.begin(), text.end(), [&](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
           kMarks.find(c) != std::string_view::npos;
  });
}

bool has_control_character(std::string_view text) {
  return std::any_of(text.begin(), text.end(), [](char c) {
    return (static_cast<unsigned char>(c) < 0x20 && c != '\t') || c == 0x7F;
  });
}

std::string_view without_blanks(std::string_view text) {
  constexpr std::string_view kBlanks = " \t";
  const std::size_t first = text.find_first_not_of(kBlanks);
  if (first == std::string_view::npos) return {};
  return text.substr(first, text.find_last_not_of(kBlanks) - first + 1);
}

// Takes the next line off `text`; a line ends with CRLF or LF (RFC 9112, section 2.2).
std::string_view take_line(std::string_view& text) {
  const std::size_t end = text.find('\n');
  QMPIPE_CHECK(end != std::string_view::npos);
  std::string_view line = text.substr(0, end);
  text.remove_prefix(end + 1);
  if (line.ends_with('\r')) line.remove_suffix(1);
  return line;
}

int hex_digit(char c) {
  if (c >= '0' && c <= '9') return c - '0';
  const char small = static_cast<char>(c | 0x20);
  return small >= 'a' && small <= 'f' ? small - 'a' + 10 : -1;
}

std::optional<std::string> percent_decoded(std::string_view text) {
  std::string decoded;
  for (std::size_t at = 0; at < text.size(); ++at) {
    if (text[at] != '%') {
      decoded += text[at];
      continue;
    }
    if (text.size() - at < 3) return std::nullopt;
    const int high = hex_digit(text[at + 1]);
    const int low = hex_digit(text[at + 2]);
    if (high < 0 || low < 0) return std::nullopt;
    decoded += static_cast<char>(16 * high + low);
    at += 2;
  }
  return decoded;
}

// The first value of `name` in a query; empty where it has none or cannot be decoded.
std::string query_value(std::string_view query, std::string_view name) {
  while (!query.empty()) {
    const std::size_t end = std::min(query.find('&'), query.size());
    const std::string_view item = query.substr(0, end);
    query.remove_prefix(std::min(end + 1, query.size()));
    if (!item.starts_with(name) || item.substr(name.size()).substr(0, 1) != "=") continue;
    return percent_decoded(item.substr(name.size() + 1)).value_or("");
  }
  return {};
}

std::optional<HeadFault> read_target(std::string_view target, RequestHead& head) {
  if (target.size() > HeadLimits::kTargetBytes) {
    return HeadFault{414, "the address is too long"};
  }
  if (target == "*") {
    head.path = target;
    return std::nullopt;
  }
  // As proxies are asked: http://host/path.
  if (const std::size_t scheme = target.find("://");
      scheme != std::string_view::npos && !target.starts_with('/')) {
    target.remove_prefix(scheme + 3);
    target.remove_prefix(std::min(target.find('/'), target.size()));
  }
  const std::size_t mark = std::min(target.find('?'), target.size());
  const std::optional<std::string> path = percent_decoded(target.substr(0, mark));
  if (!path || !path->starts_with('/')) return HeadFault{400, "the address is malformed"};
  head.path = *path;
  head.version = query_value(target.substr(std::min(mark + 1, target.size())), "v");
  return std::nullopt;
}

std::optional<HeadFault> read_first_line(std::string_view line, RequestHead& head) {
  const HeadFault malformed = {400, "the first line is no HTTP request"};
  const std::size_t first = line.find(' ');
  const std::size_t last = line.rfind(' ');
  if (first == last || has_control_character(line)) return malformed;
  const std::string_view target = line.substr(first + 1, last - first - 1);
  const std::string_view protocol = line.substr(last + 1);
  head.method = line.substr(0, first);
  if (!is_token(head.method) || target.find(' ') != std::string_view::npos) return malformed;
  if (protocol != "HTTP/1.1" && protocol != "HTTP/1.0") {
    return HeadFault{400, "only HTTP/1.1 and HTTP/1.0 are understood"};
  }
  head.keeps_alive = protocol == "HTTP/1.1";
  // RFC 9112, section 3.2.3: CONNECT names no path, and is no method of this server.
  if (head.method == "CONNECT") return std::nullopt;
  return read_target(target, head);
}

std::optional<HeadFault> read_headers(std::string_view lines, RequestHead& head) {
  for (std::string_view line = take_line(lines); !line.empty(); line = take_line(lines)) {
    if (head.headers.size() == HeadLimits::kHeaders) {
      return HeadFault{431, fmt::format("there are more than {} headers", HeadLimits::kHeaders)};
    }
    const std::size_t colon = line.find(':');
    if (colon == std::string_view::npos || !is_token(line.substr(0, colon)) ||
        has_control_character(line)) {
      return HeadFault{400, "a header is malformed"};
    }
    head.headers.emplace_back(lower_case(line.substr(0, colon)),
                              without_blanks(line.substr(colon + 1)));
  }
  return std::nullopt;
}

// RFC 9112, sections 3.2 and 6.3: nothing about where a request ends or whom it is for is guessed.
std::optional<HeadFault> read_framing(RequestHead& head) {
  const auto count = [&](std::string_view name) {
    return std::count_if(head.headers.begin(), head.headers.end(),
                         [&](const auto& header) { return header.first == name; });
  };
  const bool is_newer = head.keeps_alive;
  if (count("host") > 1 || (is_newer && count("host") == 0)) {
    return HeadFault{400, "a request names one Host"};
  }
  const std::string length = head.header("content-length");
  if (count("content-length") > 1 ||
      (count("content-length") == 1 &&
       (length.empty() || length.find_first_not_of("0123456789") != std::string::npos))) {
    return HeadFault{400, "Content-Length is no number"};
  }
  const bool is_chunked = count("transfer-encoding") > 0;
  if (is_chunked && !length.empty()) {
    return HeadFault{400, "Content-Length and Transfer-Encoding contradict each other"};
  }
  head.has_body = is_chunked || length.find_first_not_of('0') != std::string::npos;
  const std::string connection = lower_case(head.header("connection"));
  if (connection.find("close") != std::string::npos) head.keeps_alive = false;
  if (!is_newer && connection.find("keep-alive") != std::string::npos) head.keeps_alive = true;
  return std::nullopt;
}

}  // namespace

std::string RequestHead::header(std::string_view name) const {
  std::string joined;
  for (const auto& [key, value] : headers) {
    if (key == name) joined += (joined.empty() ? "" : ", ") + value;
  }
  return joined;
}

std::size_t head_length(std::string_view bytes) {
  // Line ends before the first line are skipped (RFC 9112, section 2.2).
  std::size_t at = std::min(bytes.find_first_not_of("\r\n"), bytes.size());
  for (at = bytes.find('\n', at); at != std::string_view::npos; at = bytes.find('\n', at + 1)) {
    if (bytes.substr(at + 1, 1) == "\n") return at + 2;
    if (bytes.substr(at + 1, 2) == "\r\n") return at + 3;
  }
  return 0;
}

std::variant<RequestHead, HeadFault> parse_request_head(std::string_view head) {
  QMPIPE_CHECK(!head.empty() && head_length(head) == head.size());
  head.remove_prefix(head.find_first_not_of("\r\n"));
  RequestHead parsed;
  if (auto fault = read_first_line(take_line(head), parsed)) return *std::move(fault);
  if (auto fault = read_headers(head, parsed)) return *std::move(fault);
  if (auto fault = read_framing(parsed)) return *std::move(fault);
  return parsed;
}

}  // namespace qmpipe::web
