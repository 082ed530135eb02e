#include "pipeline/web_check/check_answer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

#include "formats/bytes/gzip.h"
#include "formats/bytes/letter_case.h"
#include "formats/tile/tile_set.h"

namespace qmpipe::web_check {
namespace {

std::string trimmed(std::string_view text) {
  const std::size_t first = text.find_first_not_of(" \t");
  if (first == std::string_view::npos) return "";
  return std::string(text.substr(first, text.find_last_not_of(" \t") - first + 1));
}

// The Content-Encodings in the order in which they were applied; "identity" is none.
std::vector<std::string> encodings_of(const HttpAnswer& answer) {
  std::vector<std::string> encodings;
  for (const std::string& value : answer.all_headers("content-encoding")) {
    std::size_t at = 0;
    while (at <= value.size()) {
      const std::size_t end = std::min(value.find(',', at), value.size());
      const std::string name = lower_case(trimmed(value.substr(at, end - at)));
      if (!name.empty() && name != "identity") encodings.push_back(name);
      at = end + 1;
    }
  }
  return encodings;
}

// More than the two bytes of is_gzip(), which a plain tile may begin with by chance: the method too,
// and the flags' reserved bits.
bool looks_gzipped(std::span<const std::uint8_t> bytes) {
  return is_gzip(bytes) && bytes.size() >= 4 && bytes[2] == 8 && (bytes[3] & 0xE0U) == 0;
}

}  // namespace

void check_cors(const AskingPage& page, const WebAddress& asked, const HttpAnswer& answer,
                CheckSubject subject, CheckLog& log) {
  if (asked.origin() == page.origin) return;
  const auto add = [&](CheckKind kind, const std::string& text) {
    log.add({.kind = kind,
             .severity = page.is_stated ? CheckSeverity::kFault : text_of(kind).severity,
             .subject = subject,
             .url = answer.url,
             .text = text});
  };
  const std::vector<std::string> allowed = answer.all_headers("access-control-allow-origin");
  if (allowed.empty()) {
    add(CheckKind::kNoCors, fmt::format("a page of {} asked, and the answer has no "
                                        "Access-Control-Allow-Origin",
                                        page.origin));
  } else if (allowed.size() > 1 || allowed.front().find(',') != std::string::npos) {
    add(CheckKind::kCorsTwice,
        fmt::format("Access-Control-Allow-Origin is \"{}\"", fmt::join(allowed, ", ")));
  } else if (allowed.front() != "*" && lower_case(allowed.front()) != page.origin) {
    add(CheckKind::kCorsOtherOrigin,
        fmt::format("a page of {} asked, and Access-Control-Allow-Origin is \"{}\"", page.origin,
                    allowed.front()));
  }
}

std::optional<std::vector<std::uint8_t>> plain_body(const HttpAnswer& answer, CheckSubject subject,
                                                    CheckLog& log) {
  const auto add = [&](CheckKind kind, const std::string& text) {
    log.add(kind, subject, answer.url, text);
  };
  if (answer.is_cut_off) {
    add(CheckKind::kCutOff,
        fmt::format("the connection ended after {} bytes of the body; Content-Length is {}",
                    answer.body.size(), answer.header("content-length").value_or("not given")));
    return std::nullopt;
  }
  std::vector<std::uint8_t> body = answer.body;
  std::vector<std::string> encodings = encodings_of(answer);
  const std::size_t announced = encodings.size();
  for (; !encodings.empty(); encodings.pop_back()) {
    const std::string& encoding = encodings.back();
    if (encoding != "gzip" && encoding != "x-gzip") {
      add(CheckKind::kForeignEncoding,
          fmt::format("asked for gzip or plain bytes, the answer has \"Content-Encoding: {}\"",
                      encoding));
      return std::nullopt;
    }
    if (!looks_gzipped(body)) {
      add(CheckKind::kGzipAnnounced,
          "the answer has \"Content-Encoding: gzip\", but its body is not gzip");
      return body;
    }
    Result<std::vector<std::uint8_t>> plain = gzip_decompress(body, kLargestTileBytes);
    if (!plain) {
      add(CheckKind::kGzipDamaged, plain.error().message);
      return std::nullopt;
    }
    body = std::move(*plain);
  }
  if (announced > 1) {
    add(CheckKind::kGzipTwiceAnnounced,
        fmt::format("the body is gzipped {} times, and the answer says so", announced));
  }
  if (!looks_gzipped(body)) return body;
  const bool is_announced = announced > 0;
  add(is_announced ? CheckKind::kGzipTwice : CheckKind::kGzipNotAnnounced,
      is_announced ? "what \"Content-Encoding: gzip\" unzips to is gzip again"
                   : "the body is gzip, but the answer has no \"Content-Encoding: gzip\"");
  Result<std::vector<std::uint8_t>> plain = gzip_decompress(body, kLargestTileBytes);
  if (plain) return std::move(*plain);
  add(CheckKind::kGzipDamaged, plain.error().message);
  return std::nullopt;
}

bool is_html(std::span<const std::uint8_t> body) {
  std::string start;
  for (const std::uint8_t byte : body.first(std::min<std::size_t>(body.size(), 512))) {
    if (start.empty() &&
        (std::isspace(byte) != 0 || byte == 0xEF || byte == 0xBB || byte == 0xBF)) {
      continue;  // blanks, and a byte order mark
    }
    start += static_cast<char>(byte);
  }
  start = lower_case(start);
  return start.starts_with("<!doctype") || start.starts_with("<html") ||
         start.starts_with("<head") || start.starts_with("<body") || start.starts_with("<!--") ||
         start.starts_with("<?xml");
}

std::string status_text(const HttpAnswer& answer) {
  return fmt::format("the server answers {}", answer.status);
}

}  // namespace qmpipe::web_check
