#include "formats/points/point_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <system_error>
#include <utility>

#include "formats/bytes/letter_case.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostLineBytes = 1 << 16;
// A double has no more that mean anything, and 10 to their number must stay exact.
constexpr int kMostDecimals = 12;

bool is_blank(char c) { return c == ' ' || c == '\t' || c == '\r'; }

std::string_view trimmed(std::string_view text) {
  while (!text.empty() && is_blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && is_blank(text.back())) text.remove_suffix(1);
  if (text.size() >= 2 && text.front() == '"' && text.back() == '"') {
    text = text.substr(1, text.size() - 2);
  }
  return text;
}

// At the strongest separator that the line has, so that blanks around a comma are no fields.
void split(std::string_view line, std::vector<std::string_view>& fields) {
  fields.clear();
  char separator = 0;
  for (const char candidate : {';', ','}) {
    if (separator == 0 && line.find(candidate) != std::string_view::npos) separator = candidate;
  }
  if (separator != 0) {
    for (std::size_t end = 0; end != std::string_view::npos;) {
      end = line.find(separator);
      fields.push_back(trimmed(line.substr(0, end)));
      if (end != std::string_view::npos) line.remove_prefix(end + 1);
    }
    return;
  }
  while (!line.empty()) {
    const auto end = std::find_if(line.begin(), line.end(), is_blank);
    const auto length = static_cast<std::size_t>(end - line.begin());
    if (length > 0) fields.push_back(trimmed(line.substr(0, length)));
    line.remove_prefix(std::min(line.size(), length + 1));
  }
}

std::optional<double> number_of(std::string_view text) {
  if (text.size() > 1 && text.front() == '+' && text[1] != '-') text.remove_prefix(1);
  double value = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

// Of a number's text: digits after the point, less its exponent.
int decimals_of(std::string_view text) {
  const std::size_t e = text.find_first_of("eE");
  int exponent = 0;
  if (e != std::string_view::npos) {
    std::size_t from = e + 1;
    if (from < text.size() && text[from] == '+') ++from;
    const auto read = std::from_chars(text.data() + from, text.data() + text.size(), exponent);
    if (read.ec != std::errc()) return 0;
    text = text.substr(0, e);
  }
  const std::size_t point = text.find('.');
  const std::size_t digits = point == std::string_view::npos ? 0 : text.size() - point - 1;
  const auto after_point = static_cast<std::int64_t>(std::min<std::size_t>(digits, kMostLineBytes));
  return static_cast<int>(std::clamp<std::int64_t>(after_point - exponent, 0, kMostDecimals));
}

// 0, 1, 2 for a name of x, y, z; none for any other.
std::optional<std::size_t> axis_of(std::string_view name) {
  constexpr std::array<std::array<std::string_view, 5>, 3> kNames = {{
      {"x", "easting", "east", "lon", "longitude"},
      {"y", "northing", "north", "lat", "latitude"},
      {"z", "height", "elevation", "alt", "altitude"},
  }};
  const std::string lower = lower_case(name);
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto& names = kNames[axis];
    if (std::find(names.begin(), names.end(), lower) != names.end()) return axis;
  }
  return std::nullopt;
}

bool begins_with(std::string_view text, std::string_view start) {
  return text.substr(0, start.size()) == start;
}

}  // namespace

std::optional<Error> PointTextParser::take_names() {
  std::array<std::optional<std::size_t>, 3> found;
  for (std::size_t column = 0; column < fields_.size(); ++column) {
    const std::optional<std::size_t> axis = axis_of(fields_[column]);
    // The first of that name: a further "height" may be one above ground.
    if (axis && !found[*axis]) found[*axis] = column;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (!found[axis]) {
      return Error{
          fmt::format("line {} names its columns, but none of them {}", line_, "xyz"[axis])};
    }
    columns_[axis] = *found[axis];
  }
  return std::nullopt;
}

std::optional<Error> PointTextParser::take_point() {
  std::array<double, 3> at{};
  for (std::size_t axis = 0; axis < 3; ++axis) {
    if (columns_[axis] >= fields_.size()) {
      return Error{fmt::format("line {} has {} columns; {} is to be in column {}", line_,
                               fields_.size(), "xyz"[axis], columns_[axis] + 1)};
    }
    const std::string_view field = fields_[columns_[axis]];
    const std::optional<double> number = number_of(field);
    if (!number) {
      return Error{fmt::format("line {}: '{}' in column {} is not a number", line_,
                               field.substr(0, 40), columns_[axis] + 1)};
    }
    at[axis] = *number;
  }
  ++points_.read;
  if (!std::all_of(at.begin(), at.end(), [](double v) { return std::isfinite(v); })) {
    ++points_.non_finite;
    return std::nullopt;
  }
  for (std::size_t axis = 0; axis < 3; ++axis) {
    int& decimals = points_.decimals[axis / 2];
    decimals = std::max(decimals, decimals_of(fields_[columns_[axis]]));
  }
  points_.at.push_back(at);
  return std::nullopt;
}

std::optional<Error> PointTextParser::take_line(std::string_view line) {
  constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";
  ++line_;
  if (line_ == 1 && begins_with(line, kByteOrderMark)) line.remove_prefix(kByteOrderMark.size());
  while (!line.empty() && is_blank(line.front())) line.remove_prefix(1);
  while (!line.empty() && is_blank(line.back())) line.remove_suffix(1);
  if (line.empty() || begins_with(line, "#") || begins_with(line, "//")) return std::nullopt;
  split(line, fields_);
  const bool is_first = !std::exchange(has_begun_, true);
  if (is_first && std::any_of(fields_.begin(), fields_.end(),
                              [](std::string_view field) { return axis_of(field).has_value(); })) {
    return take_names();
  }
  return take_point();
}

std::optional<Error> PointTextParser::feed(std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const auto end = std::find(bytes.begin(), bytes.end(), '\n');
    const auto length = static_cast<std::size_t>(end - bytes.begin());
    if (rest_.size() + length > kMostLineBytes) {
      return Error{fmt::format("line {} is longer than {} bytes: this is no text of points",
                               line_ + 1, kMostLineBytes)};
    }
    rest_.append(bytes.begin(), end);
    if (end == bytes.end()) return std::nullopt;
    if (auto error = take_line(rest_)) return error;
    rest_.clear();
    bytes = bytes.subspan(length + 1);
  }
  return std::nullopt;
}

Result<TextPoints> PointTextParser::finish() {
  if (auto error = take_line(rest_)) return std::move(*error);
  return std::move(points_);
}

}  // namespace qmpipe
