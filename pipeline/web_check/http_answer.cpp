#include "pipeline/web_check/http_answer.h"

namespace qmpipe::web_check {

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

}  // namespace qmpipe::web_check
