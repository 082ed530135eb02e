#include "tools/web/byte_range.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdint>
#include <limits>
#include <optional>

namespace qmpipe::web {
namespace {

// Digits only; what does not fit is the largest number, which is past the end of any body.
std::optional<std::uint64_t> position_of(std::string_view digits) {
  if (digits.empty() || digits.find_first_not_of("0123456789") != std::string_view::npos) {
    return std::nullopt;
  }
  std::uint64_t number = 0;
  const auto read = std::from_chars(digits.data(), digits.data() + digits.size(), number);
  return read.ec == std::errc() ? number : std::numeric_limits<std::uint64_t>::max();
}

struct Span {
  std::uint64_t first = 0;  // the body's size and more: cannot be had
  std::uint64_t last = 0;   // inclusive
};

// Nothing where it is not one range of bytes.
std::optional<Span> span_of(std::string_view range, std::uint64_t size) {
  constexpr std::string_view kUnit = "bytes=";
  if (!range.starts_with(kUnit)) return std::nullopt;
  range.remove_prefix(kUnit.size());
  const std::size_t dash = range.find('-');
  if (dash == std::string_view::npos) return std::nullopt;
  const std::string_view from = range.substr(0, dash);
  const std::string_view to = range.substr(dash + 1);
  const std::optional<std::uint64_t> last = position_of(to);
  if (from.empty()) {  // the last so many bytes
    if (!last) return std::nullopt;
    return Span{size - std::min(*last, size), size - 1};
  }
  const std::optional<std::uint64_t> first = position_of(from);
  if (!first || (!last && !to.empty()) || (last && *last < *first)) return std::nullopt;
  return Span{*first, std::min(last.value_or(size), size - 1)};
}

std::string_view etag_of(const HttpReply& reply) {
  for (const auto& [name, value] : reply.headers) {
    if (name == "ETag") return value;
  }
  return {};
}

}  // namespace

HttpReply ranged_reply(HttpReply reply, std::string_view range, std::string_view if_range) {
  if (reply.status != 200 || reply.body.empty()) return reply;
  reply.headers.emplace_back("Accept-Ranges", "bytes");
  if (!if_range.empty() && if_range != etag_of(reply)) return reply;
  const std::uint64_t size = reply.body.size();
  const std::optional<Span> span = span_of(range, size);
  if (!span) return reply;
  if (span->first >= size) {
    HttpReply refusal = error_reply(416, fmt::format("there are {} bytes", size));
    refusal.headers.emplace_back("Content-Range", fmt::format("bytes */{}", size));
    return refusal;
  }
  reply.status = 206;
  reply.headers.emplace_back("Content-Range",
                             fmt::format("bytes {}-{}/{}", span->first, span->last, size));
  reply.body = reply.body.substr(span->first, span->last - span->first + 1);
  return reply;
}

}  // namespace qmpipe::web
