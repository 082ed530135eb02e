#include "pipeline/http_answer.h"

namespace qmpipe {

std::optional<std::string> HttpAnswer::header(std::string_view name) const {
  for (const HttpHeader& candidate : headers) {
    if (candidate.name == name) return candidate.value;
  }
  return std::nullopt;
}

std::vector<std::string> HttpAnswer::all_headers(std::string_view name) const {
  std::vector<std::string> values;
  for (const HttpHeader& candidate : headers) {
    if (candidate.name == name) values.push_back(candidate.value);
  }
  return values;
}

std::string lower_case(std::string_view text) {
  std::string lower(text);
  for (char& c : lower) {
    if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
  }
  return lower;
}

}  // namespace qmpipe
