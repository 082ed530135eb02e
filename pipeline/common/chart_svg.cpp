#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "pipeline/common/svg.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

constexpr double kWidth = 460;
constexpr double kHeight = 300;
constexpr double kLeft = 62;
constexpr double kRight = 12;
constexpr double kTop = 28;
constexpr double kBottom = 46;

class Axis {
 public:
  Axis(Scale scale, double low, double high) : scale_(scale) {
    if (scale_ == Scale::kLogarithmic) {
      low_ = std::floor(decimal_logarithm(low) * 4) / 4;
      high_ = std::max(std::ceil(decimal_logarithm(high) * 4) / 4, low_ + 0.25);
    } else {
      low_ = std::min(low, 0.0);
      high_ = high > low_ ? high * 1.03 : low_ + 1;
    }
  }

  // 0 at the axis's beginning, 1 at its end.
  double part(double value) const {
    const double at = scale_ == Scale::kLogarithmic ? decimal_logarithm(value) : value;
    return (at - low_) / (high_ - low_);
  }

  std::vector<double> ticks() const {
    std::vector<double> ticks;
    if (scale_ == Scale::kLogarithmic) {
      const auto last = static_cast<int>(std::floor(high_));
      for (auto power = static_cast<int>(std::floor(low_)); power <= last; ++power) {
        const double ten = whole_power(10, power);
        for (const double digit : {1.0, 2.0, 5.0}) add_within(digit * ten, ticks);
      }
      return ticks;
    }
    const double raw = (high_ - low_) / 5;
    const double power = whole_power(10.0, static_cast<int>(std::floor(decimal_logarithm(raw))));
    const double step = power * (raw / power < 1.5 ? 1 : raw / power < 3.5 ? 2 : 5);
    const auto last = static_cast<int>(std::floor(high_ / step));
    for (auto k = static_cast<int>(std::ceil(low_ / step)); k <= last; ++k) {
      ticks.push_back(k * step);
    }
    return ticks;
  }

 private:
  void add_within(double value, std::vector<double>& ticks) const {
    if (part(value) >= -1e-9 && part(value) <= 1 + 1e-9) ticks.push_back(value);
  }

  Scale scale_;
  double low_ = 0;
  double high_ = 1;
};

bool can_show(const Chart& chart, const std::pair<double, double>& point) {
  return (chart.x_scale == Scale::kLinear || point.first > 0) &&
         (chart.y_scale == Scale::kLinear || point.second > 0);
}

double x_at(double part) { return kLeft + part * (kWidth - kLeft - kRight); }
double y_at(double part) { return kHeight - kBottom - part * (kHeight - kTop - kBottom); }

std::string frame_svg(const Chart& chart, const Axis& x, const Axis& y) {
  std::string svg = fmt::format(
      "<text x=\"{:.1f}\" y=\"16\" class=\"title\">{}</text>"
      "<text x=\"{:.1f}\" y=\"{:.1f}\" class=\"label\">{}</text>"
      "<text transform=\"translate(13 {:.1f}) rotate(-90)\" class=\"label\">{}</text>",
      x_at(0.5), escaped(chart.title), x_at(0.5), kHeight - 8, escaped(chart.x_label), y_at(0.5),
      escaped(chart.y_label));
  for (const double tick : x.ticks()) {
    svg += fmt::format(
        "<path d=\"M{0:.1f} {1:.1f}V{2:.1f}\" class=\"grid\"/>"
        "<text x=\"{0:.1f}\" y=\"{3:.1f}\" class=\"label\">{4:.6g}</text>",
        x_at(x.part(tick)), y_at(0), y_at(1), y_at(0) + 15, tick);
  }
  for (const double tick : y.ticks()) {
    svg += fmt::format(
        "<path d=\"M{1:.1f} {0:.1f}H{2:.1f}\" class=\"grid\"/>"
        "<text x=\"{3:.1f}\" y=\"{4:.1f}\" class=\"value\">{5:.6g}</text>",
        y_at(y.part(tick)), x_at(0), x_at(1), x_at(0) - 5, y_at(y.part(tick)) + 4, tick);
  }
  return svg;
}

std::string line_svg(const Chart& chart, std::size_t index, const Axis& x, const Axis& y) {
  const ChartLine& line = chart.lines[index];
  std::string svg;
  std::string path;
  for (const auto& point : line.points) {
    if (!can_show(chart, point)) continue;
    const double px = x_at(x.part(point.first));
    const double py = y_at(y.part(point.second));
    if (line.dots) {
      svg += fmt::format("<circle cx=\"{:.1f}\" cy=\"{:.1f}\" r=\"4.5\" fill=\"{}\"/>", px, py,
                         colour_of(index));
    } else {
      path += fmt::format("{}{:.1f} {:.1f}", path.empty() ? "M" : "L", px, py);
    }
  }
  if (!path.empty()) {
    svg += fmt::format("<path d=\"{}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.8\"/>", path,
                       colour_of(index));
  }
  return svg;
}

}  // namespace

std::string colour_of(std::size_t line) {
  // Told apart by colour-blind readers too (Okabe and Ito).
  constexpr std::array kColours = {"#0072b2", "#d55e00", "#e69f00", "#009e73",
                                   "#cc79a7", "#56b4e9", "#555555"};
  return kColours.at(line % kColours.size());
}

std::string escaped(const std::string& text) {
  std::string result;
  for (const char c : text) {
    switch (c) {
      case '&':
        result += "&amp;";
        break;
      case '<':
        result += "&lt;";
        break;
      case '>':
        result += "&gt;";
        break;
      default:
        result += c;
    }
  }
  return result;
}

std::string chart_svg(const Chart& chart) {
  double x_low = 1e300;
  double x_high = -1e300;
  double y_low = 1e300;
  double y_high = -1e300;
  for (const ChartLine& line : chart.lines) {
    for (const auto& point : line.points) {
      if (!can_show(chart, point)) continue;
      x_low = std::min(x_low, point.first);
      x_high = std::max(x_high, point.first);
      y_low = std::min(y_low, point.second);
      y_high = std::max(y_high, point.second);
    }
  }
  if (x_low > x_high) return "";
  const Axis x(chart.x_scale, x_low, x_high);
  const Axis y(chart.y_scale, y_low, y_high);
  std::string svg =
      fmt::format("<svg class=\"chart\" viewBox=\"0 0 {} {}\" width=\"{}\" height=\"{}\">", kWidth,
                  kHeight, kWidth, kHeight);
  svg += frame_svg(chart, x, y);
  for (std::size_t k = 0; k < chart.lines.size(); ++k) svg += line_svg(chart, k, x, y);
  return svg + "</svg>\n";
}

}  // namespace qmpipe
