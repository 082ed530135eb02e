// Points as text, a point a line: x, y and z between blanks, tabs, commas or semicolons.
//
// Guarantees: any bytes give points or an Error that names the line; decimal points whatever the
// locale. Empty lines and those that begin with # or // are skipped, further columns ignored. Where the
// first line has names instead of numbers they say which columns are x, y and z.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

struct TextPoints {
  std::vector<std::array<double, 3>> at;  // finite
  // Most digits after the decimal point that a coordinate has; x and y together, and z.
  std::array<int, 2> decimals{};
  std::uint64_t read = 0;
  std::uint64_t non_finite = 0;  // left out
};

class PointTextParser {
 public:
  // The next piece of the text, of any length.
  std::optional<Error> feed(std::span<const std::uint8_t> bytes);
  // After the last piece.
  Result<TextPoints> finish();

 private:
  std::optional<Error> take_line(std::string_view line);
  std::optional<Error> take_names();
  std::optional<Error> take_point();

  TextPoints points_;
  std::string rest_;  // of a line that is not whole yet
  std::uint64_t line_ = 0;
  bool has_begun_ = false;
  std::array<std::size_t, 3> columns_ = {0, 1, 2};
  std::vector<std::string_view> fields_;  // of the line at hand
};

}  // namespace qmpipe
