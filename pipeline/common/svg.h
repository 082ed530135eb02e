// Pictures for reports as SVG text: charts, and tiles seen from above. No scripts, no references, so
// that a page with them is one file.
#pragma once

#include <span>
#include <string>
#include <vector>

#include "stages/surface/tin.h"

namespace qmpipe {

enum class Scale { kLinear, kLogarithmic };

struct ChartLine {
  std::string name;
  // x, y; drawn as a line, or as dots.
  std::vector<std::pair<double, double>> points;
  bool dots = false;
};

struct Chart {
  std::string title;
  std::string x_label;
  std::string y_label;
  Scale x_scale = Scale::kLinear;
  Scale y_scale = Scale::kLinear;
  std::vector<ChartLine> lines;
};

// What a page with charts has among its styles.
inline constexpr const char* kChartStyle =
    "svg text{font:11px sans-serif;fill:#333}svg .title{font-size:13px;text-anchor:middle}"
    "svg .label{text-anchor:middle}svg .value{text-anchor:end}"
    "svg .grid{stroke:#ddd;stroke-width:1}";

// Line k has colour_of(k). Points that a logarithmic axis cannot show are left out.
std::string chart_svg(const Chart& chart);
std::string colour_of(std::size_t line);
// Text with &, < and > made harmless.
std::string escaped(const std::string& text);

// Lit from the north-west, 512 pixels wide, heights exaggerated so that relief shows in any tile.
// The TIN with its edges, or the posts without.
std::string tin_svg(const PostGrid& grid, const Tin& tin);
std::string posts_svg(const PostGrid& grid, std::span<const float> heights_m);

}  // namespace qmpipe
