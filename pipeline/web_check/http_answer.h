// A question to a web server and its answer, as `check` looks at them. How they travel is somebody
// else's business (tools/web/http_client.h, or a test's hand-made answers).
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe::web_check {

enum class HttpMethod : std::uint8_t { kGet, kHead };

struct HttpHeader {
  std::string name;  // of an answer: in lower case
  std::string value;
};

struct HttpQuestion {
  HttpMethod method = HttpMethod::kGet;
  std::string url;
  std::vector<HttpHeader> headers;
  // A larger body is an error.
  std::size_t limit_bytes = 0;
};

struct HttpAnswer {
  int status = 0;
  // Where the answer came from, after `redirects` redirections.
  std::string url;
  int redirects = 0;
  std::vector<HttpHeader> headers;  // in the order in which they came
  // As it was sent: no Content-Encoding is undone.
  std::vector<std::uint8_t> body;
  // The connection ended before the body did (by Content-Length, or by its chunks).
  bool is_cut_off = false;

  // The value of the first header of that lower-case name; all of them.
  std::optional<std::string> header(std::string_view name) const;
  std::vector<std::string> all_headers(std::string_view name) const;
};

// The error says in words why there is no answer: "cannot connect: connection refused".
using Fetch = std::function<Result<HttpAnswer>(const HttpQuestion&)>;

}  // namespace qmpipe::web_check
