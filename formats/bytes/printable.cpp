#include "formats/bytes/printable.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace qmpipe {
namespace {

struct Character {
  enum class Kind { kWhole, kCutOff, kNone };
  Kind kind = Kind::kNone;
  std::uint32_t code = 0;
  std::size_t bytes = 1;
};

// The first character of a text that is not empty.
Character first_of(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  if (lead < 0x80) return {.kind = Character::Kind::kWhole, .code = lead, .bytes = 1};
  const std::size_t bytes = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : 2;
  if (lead < 0xC2 || lead > 0xF4) return {};
  std::uint32_t code = lead & (0x7FU >> bytes);
  for (std::size_t k = 1; k < bytes; ++k) {
    if (k == text.size()) return {.kind = Character::Kind::kCutOff, .code = 0, .bytes = k};
    const auto next = static_cast<unsigned char>(text[k]);
    if ((next & 0xC0U) != 0x80) return {};
    code = code << 6U | (next & 0x3FU);
  }
  // Written with more bytes than it needs, half of a pair, or beyond the last one.
  const std::uint32_t least = bytes == 4 ? 0x10000 : bytes == 3 ? 0x800 : 0x80;
  if (code < least || code > 0x10FFFF || (code >= 0xD800 && code < 0xE000)) return {};
  return {.kind = Character::Kind::kWhole, .code = code, .bytes = bytes};
}

bool is_shown(std::uint32_t code) {
  if (code == '\n' || code == '\t') return true;
  const bool is_control = code < 0x20 || (code >= 0x7F && code < 0xA0);
  const bool is_separator = code == 0x2028 || code == 0x2029;
  const bool is_direction = code == 0x61C || code == 0x200E || code == 0x200F ||
                            (code >= 0x202A && code <= 0x202E) ||
                            (code >= 0x2066 && code <= 0x2069);
  return !is_control && !is_separator && !is_direction;
}

struct CodeRange {
  std::uint32_t first = 0;
  std::uint32_t last = 0;
};
// Unicode's wide and full-width characters, and what is narrow between them where the gaps are small.
constexpr std::array<CodeRange, 16> kWide = {{{0x1100, 0x115F},
                                              {0x231A, 0x231B},
                                              {0x2329, 0x232A},
                                              {0x23E9, 0x23F3},
                                              {0x25FD, 0x27BF},
                                              {0x2B1B, 0x2B55},
                                              {0x2E80, 0xA4CF},
                                              {0xA960, 0xA97F},
                                              {0xAC00, 0xD7A3},
                                              {0xF900, 0xFAFF},
                                              {0xFE10, 0xFE6F},
                                              {0xFF00, 0xFF60},
                                              {0xFFE0, 0xFFE6},
                                              {0x16FE0, 0x1B2FF},
                                              {0x1F000, 0x1FAFF},
                                              {0x20000, 0x3FFFF}}};

std::int64_t columns_of_code(std::uint32_t code) {
  const bool is_wide = std::any_of(kWide.begin(), kWide.end(), [code](const CodeRange& range) {
    return code >= range.first && code <= range.last;
  });
  return is_wide ? 2 : 1;
}

std::string replaced(std::string_view text, char from, const char* to) {
  std::string result;
  for (const char c : text) {
    if (c == from) {
      result += to;
    } else {
      result += c;
    }
  }
  return result;
}

}  // namespace

std::string PrintableFilter::pass(std::string_view piece) {
  const std::string whole = begun_ + std::string(piece);
  begun_.clear();
  std::string shown;
  for (std::string_view rest = whole; !rest.empty();) {
    const Character first = first_of(rest);
    if (first.kind == Character::Kind::kCutOff) {
      begun_ = rest;
      break;
    }
    if (first.kind == Character::Kind::kNone) {
      shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(rest[0]));
    } else if (is_shown(first.code)) {
      shown += rest.substr(0, first.bytes);
    } else {
      shown += fmt::format("\\u{:04x}", first.code);
    }
    rest.remove_prefix(first.bytes);
  }
  return shown;
}

std::string PrintableFilter::finish() {
  std::string shown;
  for (const char c : begun_) shown += fmt::format("\\x{:02x}", static_cast<unsigned char>(c));
  begun_.clear();
  return shown;
}

std::string printable(std::string_view text) {
  PrintableFilter filter;
  const std::string shown = filter.pass(text);
  return shown + filter.finish();
}

std::string printable_line(std::string_view text) {
  return replaced(replaced(printable(text), '\n', "\\n"), '\t', "\\t");
}

std::string printable_message(std::string_view text) {
  std::string shown = replaced(printable(text), '\n', "\n  ");
  // Lines that are indented already.
  for (std::size_t at = shown.find("\n    "); at != std::string::npos;
       at = shown.find("\n    ", at + 1)) {
    shown.erase(at + 1, 2);
  }
  return shown;
}

std::int64_t columns_of(std::string_view line) {
  std::int64_t columns = 0;
  while (!line.empty()) {
    const Character first = first_of(line);
    columns += columns_of_code(first.code);
    line.remove_prefix(first.bytes);
  }
  return columns;
}

std::string cut_to_columns(std::string_view line, std::int64_t columns) {
  std::size_t kept = 0;
  while (kept < line.size()) {
    const Character first = first_of(line.substr(kept));
    columns -= columns_of_code(first.code);
    if (columns < 0) break;
    kept += first.bytes;
  }
  return std::string(line.substr(0, kept));
}

}  // namespace qmpipe
