#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "formats/bytes/printable.h"
#include "pipeline/build/report.h"
#include "pipeline/common/text_table.h"
#include "pipeline/verify/verify.h"

namespace qmpipe::verify {
namespace {

using Json = nlohmann::ordered_json;

TableRow heading(const VerifyReport& report) {
  TableRow row = {"zoom", "tiles", "V", "T", "bytes", "bytes/tile", "crack mm"};
  if (report.has_source) {
    for (const char* name : {"max err m", "mean err m", "RMS err m", "tolerance m", "in place m",
                             "source max m", "source RMS m"}) {
      row.emplace_back(name);
    }
  }
  if (report.hausdorff == HausdorffMode::kMeasured) {
    row.emplace_back("Hausdorff m");
    row.emplace_back("by points m");
    row.emplace_back("of tiles");
  }
  return row;
}

TableRow row_of(const VerifyReport& report, const ZoomReport& zoom) {
  TableRow row = {std::to_string(zoom.zoom),
                  grouped(zoom.tiles),
                  fmt::format("{:.1f}", zoom.mean_vertices()),
                  fmt::format("{:.1f}", zoom.mean_triangles()),
                  grouped(zoom.stored_bytes),
                  grouped(zoom.stored_bytes / zoom.tiles),
                  zoom.borders == 0 ? "-" : fmt::format("{:.3f}", zoom.largest_crack_m * 1000)};
  if (report.has_source) {
    if (zoom.error.posts == 0) {
      row.insert(row.end(), 3, "-");
    } else {
      for (const double error_m : {zoom.error.largest_m, zoom.error.mean_m(), zoom.error.rms_m()}) {
        row.push_back(fmt::format("{:.4g}", error_m));
      }
    }
    row.push_back(zoom.tolerance_m ? fmt::format("{:.6g}", *zoom.tolerance_m) : "-");
    const auto cell = [](const ErrorSummary& error, double error_m) {
      return error.posts == 0 ? "-" : fmt::format("{:.4g}", error_m);
    };
    row.push_back(cell(zoom.error, zoom.error.largest_in_place_m));
    row.push_back(cell(zoom.source_error, zoom.source_error.largest_m));
    row.push_back(cell(zoom.source_error, zoom.source_error.rms_m()));
  }
  if (report.hausdorff == HausdorffMode::kMeasured) {
    const HausdorffDistances mean = zoom.mean_hausdorff();
    for (const double distance_m : {mean.to_surfaces_m, mean.between_points_m}) {
      row.push_back(zoom.measured.empty() ? "-" : fmt::format("{:.4g}", distance_m));
    }
    row.push_back(grouped(static_cast<std::int64_t>(zoom.measured.size())));
  }
  return row;
}

std::string findings_text(const VerifyReport& report, const std::vector<Finding>& findings,
                          const char* label) {
  std::string text;
  std::array<std::int64_t, kFindingKinds> shown{};
  for (const Finding& finding : findings) {
    text += fmt::format("{} {} {}: {}\n", label, name_of(finding.kind), place_of(finding),
                        printable_line(finding.text));
    ++shown[static_cast<std::size_t>(finding.kind)];
  }
  for (std::size_t k = 0; k < kFindingKinds; ++k) {
    const auto kind = static_cast<FindingKind>(k);
    const bool is_of_label =
        (severity_of(kind) == Severity::kFault) == (std::string(label) == "fault");
    if (!is_of_label || report.counts[k] <= shown[k]) continue;
    text += fmt::format("{} {}: {} more not shown\n", label, name_of(kind),
                        grouped(report.counts[k] - shown[k]));
  }
  return text;
}

Json json_of_zoom(const VerifyReport& report, const ZoomReport& zoom) {
  Json json = {{"zoom", zoom.zoom},
               {"tiles", zoom.tiles},
               {"readable_tiles", zoom.readable_tiles},
               {"mean_vertices", zoom.mean_vertices()},
               {"mean_triangles", zoom.mean_triangles()},
               {"bytes", zoom.stored_bytes},
               {"borders", zoom.borders},
               {"largest_crack_m", zoom.largest_crack_m}};
  if (report.has_source) {
    json["error_posts"] = zoom.error.posts;
    json["max_error_m"] = zoom.error.largest_m;
    json["mean_error_m"] = zoom.error.mean_m();
    json["rms_error_m"] = zoom.error.rms_m();
    json["worst_tile"] = zoom.worst_tile ? Json(to_string(*zoom.worst_tile)) : Json(nullptr);
    json["max_error_in_place_m"] = zoom.error.largest_in_place_m;
    const ErrorSummary& own = zoom.source_error;
    json["source_posts"] = own.posts;
    json["max_source_error_m"] = own.posts > 0 ? Json(own.largest_m) : Json(nullptr);
    json["mean_source_error_m"] = own.posts > 0 ? Json(own.mean_m()) : Json(nullptr);
    json["rms_source_error_m"] = own.posts > 0 ? Json(own.rms_m()) : Json(nullptr);
    json["tolerance_m"] = zoom.tolerance_m ? Json(*zoom.tolerance_m) : Json(nullptr);
  }
  if (report.hausdorff == HausdorffMode::kMeasured) {
    json["hausdorff_tiles"] = zoom.measured.size();
    const HausdorffDistances mean = zoom.mean_hausdorff();
    const bool has_mean = !zoom.measured.empty();
    json["mean_hausdorff_m"] = has_mean ? Json(mean.to_surfaces_m) : Json(nullptr);
    json["mean_hausdorff_points_m"] = has_mean ? Json(mean.between_points_m) : Json(nullptr);
  }
  return json;
}

Json json_of_findings(const std::vector<Finding>& findings) {
  Json list = Json::array();
  for (const Finding& finding : findings) {
    list.push_back(
        {{"kind", name_of(finding.kind)}, {"tile", place_of(finding)}, {"text", finding.text}});
  }
  return list;
}

}  // namespace

std::string text_of(const VerifyReport& report) {
  std::vector<TableRow> rows = {heading(report)};
  for (const ZoomReport& zoom : report.zooms) rows.push_back(row_of(report, zoom));
  std::string text = table_text(rows);
  double largest_m = 0;
  for (const ZoomReport& zoom : report.zooms) {
    largest_m = std::max(largest_m, zoom.tolerance_m.value_or(0));
  }
  text += coarse_zooms_text(largest_m);
  text += findings_text(report, report.warnings, "warning");
  text += findings_text(report, report.faults, "fault");
  text += "verify: " + counted(report.tiles, "tile") + ", " + counted(report.fault_count, "fault");
  if (report.warning_count > 0) text += ", " + counted(report.warning_count, "warning");
  return text + fmt::format(", largest crack {:.2f} mm\n", report.largest_crack_m * 1000);
}

std::string json_of(const VerifyReport& report) {
  Json counts = Json::object();
  for (std::size_t k = 0; k < kFindingKinds; ++k) {
    if (report.counts[k] > 0) counts[name_of(static_cast<FindingKind>(k))] = report.counts[k];
  }
  Json zooms = Json::array();
  for (const ZoomReport& zoom : report.zooms) zooms.push_back(json_of_zoom(report, zoom));
  const Json json = {{"tiles", report.tiles},
                     {"fault_count", report.fault_count},
                     {"warning_count", report.warning_count},
                     {"counts", counts},
                     {"largest_crack_m", report.largest_crack_m},
                     {"zooms", zooms},
                     {"faults", json_of_findings(report.faults)},
                     {"warnings", json_of_findings(report.warnings)}};
  // Texts may quote bytes of a damaged layer.json.
  return json.dump(2, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace qmpipe::verify
