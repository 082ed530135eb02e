#include "pipeline/detail_model/chart.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "pipeline/common/svg.h"
#include "scheduler/check.h"
#include "scheduler/elementary.h"

namespace qmpipe {
namespace {

// As many as the paper's figure has.
constexpr std::size_t kStates = 21;
// A threshold of zero has no place among ratios: a flat block is shown from here on.
constexpr double kLeastSvo_m = 1e-4;

std::vector<double> thresholds_m(double finest_m, double coarsest_m, std::size_t count) {
  QMPIPE_CHECK(count >= 2);
  const double low = std::max(finest_m, kLeastSvo_m);
  const double high = std::max(coarsest_m, low);
  std::vector<double> values;
  for (std::size_t k = 0; k < count; ++k) {
    const double share = static_cast<double>(k) / static_cast<double>(count - 1);
    values.push_back(low * power(high / low, share));
  }
  // Not a rounding error short of the coarsest level.
  values.back() = high;
  return values;
}

double distance_for_svo_m(double svo_m, const DetailView& view) {
  return svo_m / svo_at_distance_m(1, view);
}

std::vector<DetailState> states_of(const DetailModel& model, const std::vector<std::size_t>& blocks,
                                   const DetailView& view, std::size_t count) {
  double finest_m = 0;
  double coarsest_m = 0;
  for (const std::size_t b : blocks) {
    finest_m = std::max(finest_m, static_cast<double>(model.blocks[b].svo_m.back()));
    coarsest_m = std::max(coarsest_m, static_cast<double>(model.blocks[b].svo_m.front()));
  }
  std::vector<DetailState> states;
  for (const double svo_m : thresholds_m(finest_m, coarsest_m, count)) {
    const DetailLevels levels = levels_for_svo(model, svo_m);
    DetailState& state = states.emplace_back();
    state.svo_m = svo_m;
    state.distance_m = distance_for_svo_m(svo_m, view);
    for (const std::size_t b : blocks) {
      const DetailBlock& block = model.blocks[b];
      state.triangles += static_cast<std::int64_t>(block.triangles_at(levels[b]));
      state.simplifications += static_cast<std::int64_t>(block.levels() - levels[b]);
    }
  }
  return states;
}

Chart chart_of(const DetailModel& model, const DetailView& view, const std::string& title,
               const std::string& y_label, const std::function<double(const DetailState&)>& value) {
  Chart chart = {.title = title,
                 .x_label = "SVO threshold (m)",
                 .y_label = y_label,
                 .x_scale = Scale::kLogarithmic,
                 .y_scale = Scale::kLogarithmic,
                 .lines = {}};
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    ChartLine& line = chart.lines.emplace_back();
    line.name = fmt::format("block {}", b);
    for (const DetailState& state : block_states(model, b, view, kStates)) {
      line.points.emplace_back(state.svo_m, value(state));
    }
  }
  return chart;
}

}  // namespace

std::vector<DetailState> block_states(const DetailModel& model, std::size_t block,
                                      const DetailView& view, std::size_t count) {
  QMPIPE_CHECK(block < model.blocks.size());
  return states_of(model, {block}, view, count);
}

std::vector<DetailState> model_states(const DetailModel& model, const DetailView& view,
                                      std::size_t count) {
  std::vector<std::size_t> blocks(model.blocks.size());
  for (std::size_t b = 0; b < blocks.size(); ++b) blocks[b] = b;
  return states_of(model, blocks, view, count);
}

std::string detail_chart_page(const DetailModel& model, const DetailView& view,
                              const std::string& title) {
  std::string page = fmt::format(
      "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>{0}</title>\n"
      "<style>body{{font:15px/1.5 sans-serif;max-width:60em;margin:2em auto}}{4}</style>\n"
      "</head><body><h1>{0}</h1>\n<p>A field of view of {1:g} degrees, a screen {2:g} pixels high, "
      "a smallest visible object {3:g} pixels long.</p>\n",
      escaped(title), view.fov_deg, view.screen_height, view.pixels, kChartStyle);
  page +=
      chart_svg(chart_of(model, view, "Triangles", "triangles of the block",
                         [](const DetailState& s) { return static_cast<double>(s.triangles); }));
  page += chart_svg(
      chart_of(model, view, "Simplifications", "collapses from the finest level",
               [](const DetailState& s) { return static_cast<double>(s.simplifications); }));
  page += chart_svg(chart_of(model, view, "Visual range", "distance (m)",
                             [](const DetailState& s) { return s.distance_m; }));
  return page + "</body></html>\n";
}

}  // namespace qmpipe
