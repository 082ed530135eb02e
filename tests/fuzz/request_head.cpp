// Any bytes: the end of a head is found alike in pieces and at once, parse_request_head() neither throws
// nor over-reads, and what it takes keeps its limits.
#include "tools/web/request_head.h"

#include <cstdint>
#include <cstdlib>
#include <string_view>
#include <variant>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string_view bytes(reinterpret_cast<const char*>(data), size);
  const std::size_t length = qmpipe::web::head_length(bytes);
  if (length > size) std::abort();
  if (length == 0) return 0;
  if (qmpipe::web::head_length(bytes.substr(0, length)) != length ||
      qmpipe::web::head_length(bytes.substr(0, length - 1)) != 0) {
    std::abort();
  }
  const auto parsed = qmpipe::web::parse_request_head(bytes.substr(0, length));
  if (const auto* fault = std::get_if<qmpipe::web::HeadFault>(&parsed)) {
    if (fault->status < 400 || fault->status > 499 || fault->message.empty()) std::abort();
    return 0;
  }
  const auto& head = *std::get_if<qmpipe::web::RequestHead>(&parsed);
  if (head.headers.size() > qmpipe::web::HeadLimits::kHeaders) std::abort();
  if (head.path.size() > qmpipe::web::HeadLimits::kTargetBytes) std::abort();
  if (head.method != "CONNECT" && head.path != "*" && !head.path.starts_with('/')) std::abort();
  for (const auto& [name, value] : head.headers) {
    if ((name + value).find_first_of("\r\n") != std::string::npos) std::abort();
  }
  return 0;
}
