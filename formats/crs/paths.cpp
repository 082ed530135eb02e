#include "formats/crs/paths.h"

#include <cpl_conv.h>
#include <cpl_string.h>

#include <algorithm>

#include "formats/bytes/letter_case.h"

namespace qmpipe {
namespace {

using Found = std::optional<std::string>;

constexpr std::string_view kBlanks = " \t\r\n\f\v";
constexpr std::size_t npos = std::string_view::npos;

bool is_path(std::string_view name) {
  return !name.empty() && (name.find_first_of("/\\") != npos || name.front() == '~');
}

// Of a list as in +nadgrids=@a.gsb,b.gsb, where @ marks what may be missing.
Found path_in_list(std::string_view names) {
  while (!names.empty()) {
    const std::size_t comma = std::min(names.find(','), names.size());
    std::string_view name = names.substr(0, comma);
    name.remove_prefix(std::min(name.find_first_not_of("@\"' \t\r\n"), name.size()));
    while (!name.empty() && (name.back() == '"' || name.back() == '\'')) name.remove_suffix(1);
    if (is_path(name)) return std::string(name);
    names.remove_prefix(std::min(comma + 1, names.size()));
  }
  return std::nullopt;
}

bool names_a_file(const std::string& key) {
  return key.ends_with("grids") || key == "init" || key == "file" || key == "model" ||
         key == "catalog";
}

// Parameters apart by blanks, each with a + or none.
Found path_in_proj_string(std::string_view text) {
  while (true) {
    text.remove_prefix(std::min(text.find_first_not_of(kBlanks), text.size()));
    if (text.empty()) return std::nullopt;
    std::string_view word = text.substr(0, text.find_first_of(kBlanks));
    text.remove_prefix(word.size());
    while (!word.empty() && (word.front() == '+' || word.front() == '"')) word.remove_prefix(1);
    const std::size_t equals = word.find('=');
    if (equals == npos || !names_a_file(lower_case(word.substr(0, equals)))) continue;
    if (Found path = path_in_list(word.substr(equals + 1))) return path;
  }
}

// In lower case; of a whole value.
bool is_proj_string(std::string_view lower) {
  return lower.find("+proj") != npos || lower.find("+init") != npos || lower.starts_with("proj ") ||
         lower.starts_with("proj=") || lower.starts_with("init=");
}

// What the quotation mark at `quote` begins. WKT doubles a mark within marks; of JSON's, with a backslash
// before, what comes behind is not wanted here.
std::string_view quoted_at(std::string_view text, std::size_t quote) {
  std::size_t end = quote + 1;
  for (; end < text.size(); ++end) {
    if (text[end] != '"') continue;
    if (end + 1 >= text.size() || text[end + 1] != '"') break;
    ++end;
  }
  return text.substr(quote + 1, std::min(end, text.size()) - quote - 1);
}

bool begins_value(std::string_view text, std::size_t quote) {
  const std::size_t before = text.substr(0, quote).find_last_not_of(kBlanks);
  return before != npos && std::string_view(",[(:").find(text[before]) != npos;
}

// A PROJ string that is a name or a value in WKT or PROJJSON, as of EXTENSION, METHOD and REMARK.
// Marks are not taken in pairs: a stray one would turn the pairs inside out.
Found path_in_quoted_proj_strings(std::string_view text, std::string_view lower) {
  for (std::size_t at = text.find('"'); at != npos; at = text.find('"', at + 1)) {
    if (!begins_value(text, at)) continue;
    const std::string_view value = quoted_at(text, at);
    if (!is_proj_string(lower.substr(at + 1, value.size()))) continue;
    if (Found path = path_in_proj_string(value)) return path;
  }
  return std::nullopt;
}

// The quoted text that comes `skipped` others later behind each `word`, with marks between alone.
Found path_behind(std::string_view text, std::string_view lower, std::string_view word,
                  int skipped) {
  for (std::size_t at = lower.find(word); at != npos; at = lower.find(word, at + 1)) {
    std::size_t from = at + word.size();
    std::string_view value;
    for (int k = 0; k <= skipped; ++k) {
      const std::size_t quote = text.find_first_not_of(" \t\r\n\f\v,[(:", from);
      if (quote == npos || text[quote] != '"') break;
      value = k == skipped ? quoted_at(text, quote) : "";
      from = quote + quoted_at(text, quote).size() + 2;
    }
    if (Found path = path_in_list(value)) return path;
  }
  return std::nullopt;
}

// WKT may have the quotation marks of print.
std::string with_plain_quotes(std::string_view text) {
  constexpr std::size_t kBytes = 3;
  if (text.find("\u201c") == npos && text.find("\u201d") == npos) return std::string(text);
  std::string plain;
  while (!text.empty()) {
    const std::string_view next = text.substr(0, kBytes);
    const bool is_printed = next == "\u201c" || next == "\u201d";
    plain += is_printed ? '"' : text.front();
    text.remove_prefix(is_printed ? kBytes : 1);
  }
  return plain;
}

std::string without_entities(std::string_view text) {
  const std::string copy(text);
  char* const plain = CPLUnescapeString(copy.c_str(), nullptr, CPLES_XML);
  std::string result = plain != nullptr ? plain : "";
  CPLFree(plain);
  return result;
}

// Inside of < and >: an element's name and attributes, or a section that may hold anything.
Found path_in_tag(std::string_view tag) {
  constexpr std::string_view kSection = "![CDATA[";
  if (tag.starts_with(kSection)) return path_in_crs(tag.substr(kSection.size()));
  while (!tag.empty()) {
    const std::size_t quote = std::min(tag.find_first_of("\"'"), tag.size());
    if (Found path = path_in_crs(without_entities(tag.substr(0, quote)))) return path;
    tag.remove_prefix(std::min(quote + 1, tag.size()));
  }
  return std::nullopt;
}

}  // namespace

std::optional<std::string> path_in_crs(std::string_view text) {
  const std::string plain = with_plain_quotes(text);
  const std::string lower = lower_case(plain);
  const std::size_t start = std::min(lower.find_first_not_of(kBlanks), lower.size());
  // Names of programs that made a file stand between bytes that are no text.
  const bool is_text = lower.find('\0') == npos && lower.find('[') == npos;
  if (is_text && is_proj_string(std::string_view(lower).substr(start))) {
    if (Found path = path_in_proj_string(plain)) return path;
  }
  if (Found path = path_behind(plain, lower, "proj4_grids\"", 0)) return path;
  if (Found path = path_behind(plain, lower, "parameterfile", 1)) return path;
  if (lower.find("\"parameters\"") != npos) {
    if (Found path = path_behind(plain, lower, "\"value\"", 0)) return path;
  }
  return path_in_quoted_proj_strings(plain, lower);
}

std::optional<std::string> path_in_crs_of_xml(std::string_view xml) {
  bool in_tag = false;
  while (!xml.empty()) {
    const std::size_t end = std::min(xml.find(in_tag ? '>' : '<'), xml.size());
    const std::string_view piece = xml.substr(0, end);
    Found path = in_tag ? path_in_tag(piece) : path_in_crs(without_entities(piece));
    if (path) return path;
    in_tag = !in_tag;
    xml.remove_prefix(std::min(end + 1, xml.size()));
  }
  return std::nullopt;
}

}  // namespace qmpipe
