#include "tools/arguments/parse_values.h"

#include <charconv>
#include <cmath>
#include <string_view>

#include "formats/bytes/errors.h"

namespace qmpipe {
namespace {

template <class Number>
std::optional<Number> whole_number(std::string_view text) {
  Number value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc() || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

std::int64_t parse_size(const std::string& option, const std::string& text) {
  std::string_view rest = text;
  for (const std::string_view ending : {"iB", "B", "b"}) {
    if (rest.ends_with(ending)) {
      rest.remove_suffix(ending.size());
      break;
    }
  }
  double factor = 1;
  const std::string_view letters = "KMGT";
  const char last = rest.empty() ? '0' : static_cast<char>(rest.back() & ~0x20);
  if (const auto power = letters.find(last); power != std::string_view::npos) {
    factor = std::ldexp(1.0, 10 * (static_cast<int>(power) + 1));
    rest.remove_suffix(1);
  }
  const auto number = whole_number<double>(rest);
  if (!number || !std::isfinite(*number) || *number < 0 || *number * factor > 1e18) {
    throw UsageError(option + " " + text + ": give a size such as 512M or 2G");
  }
  return static_cast<std::int64_t>(*number * factor);
}

std::optional<int> parse_gzip(const std::string& text) {
  if (text == "none") return std::nullopt;
  const auto level = whole_number<int>(text);
  if (!level || *level < 1 || *level > 12) {
    throw UsageError("--gzip " + text + ": give a level from 1 (fast) to 12 (small), or none");
  }
  return level;
}

std::map<std::int32_t, double> parse_tolerances(const std::string& text) {
  std::map<std::int32_t, double> tolerances;
  std::string_view rest = text;
  while (!rest.empty()) {
    const auto comma = rest.find(',');
    const std::string_view entry = rest.substr(0, comma);
    rest = comma == std::string_view::npos ? std::string_view() : rest.substr(comma + 1);
    const auto equals = entry.find('=');
    const auto zoom = whole_number<std::int32_t>(entry.substr(0, equals));
    const auto metres = equals == std::string_view::npos
                            ? std::nullopt
                            : whole_number<double>(entry.substr(equals + 1));
    if (!zoom || !metres) {
      throw UsageError("--tolerance-at " + text +
                       ": give zoom=metres, separated by commas, such as 9=20,10=8.5");
    }
    tolerances[*zoom] = *metres;
  }
  return tolerances;
}

bool is_local_frame(const std::string& frame, MeshFormat format) {
  if (frame != "crs") return true;
  if (format == MeshFormat::kGlb || format == MeshFormat::kStl) {
    throw UsageError(
        "--frame crs: the float32 of .glb and .stl is too coarse for the coordinates of a CRS; "
        "write a .ply or .obj, or leave --frame out");
  }
  return false;
}

}  // namespace qmpipe
