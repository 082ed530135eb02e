// Any bytes: PointTextParser neither throws nor over-reads, takes the text in pieces of any size alike,
// and what it accepts is finite. The first byte is the size of the pieces.
#include "formats/points/point_text.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <optional>
#include <span>

namespace {

std::optional<qmpipe::TextPoints> parse(std::span<const std::uint8_t> text, std::size_t piece) {
  qmpipe::PointTextParser parser;
  while (!text.empty()) {
    const std::size_t count = std::min(piece, text.size());
    if (parser.feed(text.first(count))) return std::nullopt;
    text = text.subspan(count);
  }
  auto points = parser.finish();
  if (!points.ok()) return std::nullopt;
  return *points;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 1) return 0;
  const auto text = std::span(data, size).subspan(1);
  const auto whole = parse(text, std::max<std::size_t>(1, text.size()));
  const auto pieces = parse(text, 1U + data[0]);
  if (whole.has_value() != pieces.has_value()) std::abort();
  if (!whole) return 0;
  if (whole->at != pieces->at || whole->read != whole->at.size() + whole->non_finite) std::abort();
  for (const auto& point : whole->at) {
    for (const double value : point) {
      if (!std::isfinite(value)) std::abort();
    }
  }
  return 0;
}
