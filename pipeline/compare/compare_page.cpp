#include "pipeline/compare/compare_page.h"

#include <fmt/format.h>

#include <algorithm>

#include "pipeline/build/estimate.h"
#include "pipeline/common/svg.h"
#include "pipeline/common/version.h"
#include "pipeline/compare/compare_tables.h"

namespace qmpipe {
namespace {

// More points than pixels only make the page heavy.
constexpr std::size_t kMostPlotted = 400;

constexpr const char* kStyle =
    "body{font:15px/1.45 sans-serif;margin:2em auto;max-width:1120px;padding:0 1em;color:#222}"
    "table{border-collapse:collapse;margin:.6em 0 1.6em}"
    "th,td{padding:.25em .7em;text-align:right;border-bottom:1px solid #ddd}"
    "th:first-child,td:first-child{text-align:left}th{border-bottom:2px solid #888}"
    "td.best{font-weight:bold}td.bad{color:#b00;font-weight:bold}"
    ".key{display:inline-block;width:.8em;height:.8em;margin-right:.5em;border-radius:2px}"
    ".charts,.tiles{display:flex;flex-wrap:wrap;gap:1em}figure{margin:0 0 1em}"
    "figcaption{font-size:14px;max-width:512px}"
    "svg.tile{max-width:100%;height:auto}";

struct Rows {
  const ComparedMethod* method;
  std::size_t number;
  std::vector<ComparedZoom> zooms;
};

std::string method_cell(const Rows& rows) {
  return fmt::format("<td><span class=\"key\" style=\"background:{}\"></span>{}</td>",
                     colour_of(rows.number), escaped(name_of(rows.method->choice)));
}

std::string cell(double value, bool best) {
  return fmt::format("<td{}>{:.4g}</td>", best ? " class=\"best\"" : "", value);
}

std::string single_tile_section(const Comparison& comparison, const std::vector<Rows>& all) {
  std::string html = fmt::format(
      "<h2>One tile alone</h2><p>Tile {} without its neighbours' borders; run times are medians of "
      "five runs on one core (the paper's Table 2).</p><table><tr><th>method</th>"
      "<th>parameters</th><th>run time, ms</th><th>vertices</th><th>triangles</th>"
      "<th>largest error, m</th><th>RMS error, m</th><th>Hausdorff, m</th></tr>",
      to_string(*comparison.tile));
  for (const Rows& rows : all) {
    const TileTrial& trial = *rows.method->trial;
    std::string parameters;
    for (const auto& [name, value] : trial.parameters) {
      parameters += fmt::format("{} = {:g} ", name, value);
    }
    html += fmt::format(
        "<tr>{}<td>{}</td><td>{:.1f}</td><td>{}</td><td>{}</td><td>{:.4g}</td><td>{:.4g}</td>"
        "<td>{:.4g}</td></tr>",
        method_cell(rows), parameters, 1000 * trial.seconds, trial.tin.vertices.size(),
        trial.tin.triangle_count(), trial.error.largest_m, trial.error.rms_m(),
        trial.hausdorff.to_surfaces_m);
  }
  return html + "</table>\n";
}

std::string pictures_section(const Comparison& comparison) {
  const TilingScheme scheme(comparison.projection);
  const PostGrid grid = make_tile_grid(scheme, *comparison.tile);
  std::string html = fmt::format(
      "<h2>The same tile under each method</h2><p>Tile {} from above, lit from the north-west, "
      "relief exaggerated.</p><div class=\"tiles\"><figure>{}<figcaption>all {} posts"
      "</figcaption></figure>",
      to_string(*comparison.tile), posts_svg(grid, comparison.tile_heights_m),
      comparison.tile_heights_m.size());
  for (const ComparedMethod& method : comparison.methods) {
    html += fmt::format("<figure>{}<figcaption>{}: {} triangles</figcaption></figure>",
                        tin_svg(grid, method.trial->tin), escaped(name_of(method.choice)),
                        method.trial->tin.triangle_count());
  }
  return html + "</div>\n";
}

// Ascending by mean distance.
std::string ranking(const std::vector<Rows>& all, std::size_t zoom) {
  std::vector<const Rows*> order;
  for (const Rows& rows : all) order.push_back(&rows);
  std::stable_sort(order.begin(), order.end(), [zoom](const Rows* a, const Rows* b) {
    return a->zooms[zoom].hausdorff_m < b->zooms[zoom].hausdorff_m;
  });
  std::string text;
  for (const Rows* rows : order) {
    text += (text.empty() ? "" : ", ") + name_of(rows->method->choice);
  }
  return text;
}

std::string zoom_table(const std::vector<Rows>& all, std::size_t k) {
  const ComparedZoom& first = all.front().zooms[k];
  std::string html = fmt::format(
      "<h3>Zoom {}: {} of {} tiles without voids</h3><table><tr><th>method</th><th>V</th><th>T</th>"
      "<th>H, m</th><th>largest error, m</th><th>RMS error, m</th><th>bytes a tile</th>"
      "<th>ms a tile</th></tr>",
      first.zoom, first.full_tiles, first.tiles);
  double best_m = first.hausdorff_m;
  for (const Rows& rows : all) best_m = std::min(best_m, rows.zooms[k].hausdorff_m);
  for (const Rows& rows : all) {
    const ComparedZoom& zoom = rows.zooms[k];
    html += fmt::format(
        "<tr>{}<td>{:.1f}</td><td>{:.1f}</td>{}<td>{:.4g}</td><td>{:.4g}</td>"
        "<td>{:.0f}</td><td>{:.1f}</td></tr>",
        method_cell(rows), zoom.mean_vertices, zoom.mean_triangles,
        cell(zoom.hausdorff_m, zoom.hausdorff_m == best_m), zoom.largest_error_m, zoom.rms_error_m,
        zoom.mean_bytes, zoom.mean_tile_ms);
  }
  return html + fmt::format("</table><p>By mean distance: {}.</p>\n", ranking(all, k));
}

Chart distance_chart(const std::vector<Rows>& all, std::size_t k) {
  Chart chart{.title = fmt::format("Zoom {}: sorted distances", all.front().zooms[k].zoom),
              .x_label = "tile",
              .y_label = "symmetric Hausdorff distance, m",
              .lines = {}};
  for (const Rows& rows : all) {
    ChartLine line{.name = name_of(rows.method->choice), .points = {}};
    const std::vector<double>& sorted = rows.zooms[k].sorted_hausdorff_m;
    const std::size_t step = std::max<std::size_t>(1, sorted.size() / kMostPlotted);
    for (std::size_t at = 0; at < sorted.size(); at += step) {
      line.points.emplace_back(static_cast<double>(at + 1), sorted[at]);
    }
    if (!sorted.empty())
      line.points.emplace_back(static_cast<double>(sorted.size()), sorted.back());
    chart.lines.push_back(std::move(line));
  }
  return chart;
}

Chart cost_chart(const std::vector<Rows>& all, std::size_t k) {
  Chart chart{.title = fmt::format("Zoom {}: distance against size", all.front().zooms[k].zoom),
              .x_label = "triangles a tile",
              .y_label = "mean Hausdorff distance, m",
              .x_scale = Scale::kLogarithmic,
              .y_scale = Scale::kLogarithmic,
              .lines = {}};
  for (const Rows& rows : all) {
    const ComparedZoom& zoom = rows.zooms[k];
    chart.lines.push_back({.name = name_of(rows.method->choice),
                           .points = {{zoom.mean_triangles, zoom.hausdorff_m}},
                           .dots = true});
  }
  return chart;
}

std::string legend(const std::vector<Rows>& all) {
  std::string html = "<table><tr>";
  for (const Rows& rows : all) html += method_cell(rows);
  return html + "</tr></table>\n";
}

std::string zooms_section(const std::vector<Rows>& all) {
  std::string tables;
  std::string charts;
  for (std::size_t k = 0; k < all.front().zooms.size(); ++k) {
    if (all.front().zooms[k].full_tiles == 0) continue;
    tables += zoom_table(all, k);
    charts += chart_svg(distance_chart(all, k)) + chart_svg(cost_chart(all, k));
  }
  if (tables.empty()) return "<p>No zoom has a tile without voids: nothing to compare.</p>\n";
  return "<h2>By zoom</h2><p>Means over the tiles without voids: vertices, triangles, and the "
         "symmetric Hausdorff distance in ECEF between a tile and the triangulation of all its "
         "posts, from vertices and 2000 random points of each to the other's surface (the paper's "
         "Table 4). Errors are vertical, at every valid post of all tiles. The smallest distance "
         "is bold; it says nothing without the number of triangles beside it.</p>\n" +
         tables + legend(all) + "<div class=\"charts\">" + charts + "</div>\n";
}

std::string run_times_section(const Comparison& comparison, const std::vector<Rows>& all) {
  std::string html = fmt::format(
      "<h2>Whole pyramid</h2><p>Run times on {} thread{} (the paper's Table 5), and what "
      "verification found.</p><table><tr><th>method</th><th>survey, s</th><th>mesh, s</th>"
      "<th>tiles</th><th>size</th><th>largest crack, mm</th><th>faults</th></tr>",
      comparison.threads, comparison.threads == 1 ? "" : "s");
  for (const Rows& rows : all) {
    const BuildReport& build = rows.method->build;
    const verify::VerifyReport& verify = rows.method->verify;
    html += fmt::format(
        "<tr>{}<td>{:.1f}</td><td>{:.1f}</td><td>{}</td><td>{}</td><td>{:.2f}</td>"
        "<td{}>{}</td></tr>",
        method_cell(rows), build.survey_s, build.mesh_s, build.tiles,
        bytes_text(build.stored_bytes), 1000 * verify.largest_crack_m,
        verify.fault_count > 0 ? " class=\"bad\"" : "", verify.fault_count);
  }
  return html + "</table>\n";
}

}  // namespace

std::string comparison_page(const Comparison& comparison) {
  std::vector<Rows> all;
  for (const ComparedMethod& method : comparison.methods) {
    all.push_back({&method, all.size(), zooms_of(method)});
  }
  std::string inputs;
  for (const std::string& input : comparison.inputs) {
    inputs += (inputs.empty() ? "" : ", ") + escaped(input);
  }
  std::string html = fmt::format(
      "<!DOCTYPE html><html lang=\"en\"><head><meta charset=\"utf-8\"><title>Simplification "
      "methods "
      "on {0}</title><style>{1}</style></head><body><h1>Simplification methods on {0}</h1>"
      "<p>Made by qmpipe {2} compare, after Campos et al. 2020, section 5.</p>\n",
      inputs, std::string(kStyle) + kChartStyle, kProgramVersion);
  html += run_times_section(comparison, all) + zooms_section(all);
  if (comparison.tile) {
    html += single_tile_section(comparison, all) + pictures_section(comparison);
  }
  return html + "</body></html>\n";
}

}  // namespace qmpipe
