// The head of an HTTP/1 request, from bytes that anybody may have sent: its first line and its headers,
// and what of them this program answers by. Strict where RFC 9112 says that a server must not guess.
#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace qmpipe::web {

// What a head may have; none of a browser's comes near them.
struct HeadLimits {
  static constexpr std::size_t kBytes = std::size_t{32} << 10U;
  static constexpr std::size_t kTargetBytes = std::size_t{8} << 10U;
  static constexpr std::size_t kHeaders = 100;
};

struct RequestHead {
  std::string method;
  std::string path;     // percent-decoded, without the query; "*" as it is
  std::string version;  // percent-decoded value of the query's "v"
  std::vector<std::pair<std::string, std::string>> headers;  // names in lower case
  bool has_body = false;
  bool keeps_alive = true;

  // Of the headers with that lower-case name, joined by commas; empty where there is none.
  std::string header(std::string_view name) const;
};

struct HeadFault {
  int status = 400;
  std::string message;
};

// The bytes of `bytes` up to and including the empty line that ends a head; 0 while it has not come.
std::size_t head_length(std::string_view bytes);

// REQUIRES: head_length(head) == head.size() > 0. Never throws for what the bytes say.
std::variant<RequestHead, HeadFault> parse_request_head(std::string_view head);

}  // namespace qmpipe::web
