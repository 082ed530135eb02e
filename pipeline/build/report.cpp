#include "pipeline/build/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace qmpipe {
namespace {

nlohmann::ordered_json zoom_object(const BuiltZoom& zoom) {
  nlohmann::ordered_json object = {
      {"zoom", zoom.zoom},
      {"tiles", zoom.tiles},
      {"vertices", zoom.vertices},
      {"triangles", zoom.triangles},
      {"plain_bytes", zoom.plain_bytes},
      {"stored_bytes", zoom.stored_bytes},
      {"tolerance_m", zoom.tolerance_m ? nlohmann::ordered_json(*zoom.tolerance_m) : nullptr},
      {"height_step_m", zoom.height_step_m},
      {"parameters", zoom.parameters},
      {"valid_posts", zoom.error.posts},
      {"max_error_m", zoom.error.largest_m},
      {"max_error_in_place_m", zoom.error.largest_in_place_m},
      {"mean_error_m", zoom.error.mean_m()},
      {"rms_error_m", zoom.error.rms_m()}};
  for (std::size_t k = 0; k < kStageCount; ++k) {
    object["stage_s"][kStageNames[k]] = zoom.seconds[k];
  }
  return object;
}

}  // namespace

void BuiltZoom::add(const TileWork& work) {
  ++tiles;
  vertices += static_cast<std::int64_t>(work.vertices);
  triangles += static_cast<std::int64_t>(work.triangles);
  plain_bytes += static_cast<std::int64_t>(work.plain_bytes);
  stored_bytes += static_cast<std::int64_t>(work.bytes.size());
  error.add(work.error);
  for (std::size_t k = 0; k < kStageCount; ++k) seconds[k] += work.seconds[k];
}

void BuildReport::add(const TileWork& work) {
  const auto found = std::find_if(zooms.begin(), zooms.end(), [&work](const BuiltZoom& zoom) {
    return zoom.zoom == work.key.zoom;
  });
  QMPIPE_CHECK(found != zooms.end());
  found->add(work);
  ++tiles;
  stored_bytes += static_cast<std::int64_t>(work.bytes.size());
  // A sum does not depend on the order of its terms.
  content_hash += work.content_hash;
}

std::string write_report(const BuildReport& report) {
  nlohmann::ordered_json object = {{"method", name_of(report.method)},
                                   {"stop", name_of(report.stop)},
                                   {"tiles", report.tiles},
                                   {"stored_bytes", report.stored_bytes},
                                   {"resumed_tiles", report.resumed_tiles},
                                   {"threads", report.threads},
                                   {"survey_s", report.survey_s},
                                   {"mesh_s", report.mesh_s},
                                   {"max_in_flight", report.max_in_flight},
                                   {"largest_in_flight", report.largest_in_flight},
                                   {"expected_peak_bytes", report.expected_peak_bytes},
                                   {"peak_resident_bytes", report.peak_resident_bytes}};
  object["source"] = {{"blocks", report.source_reads.blocks},
                      {"decoded_blocks", report.source_reads.decoded_blocks},
                      {"decoded_per_block", report.source_reads.decoded_per_block()},
                      {"decoded_bytes", report.source_reads.decoded_bytes}};
  if (!report.built_from.empty()) {
    object["built_from"] = nlohmann::ordered_json::parse(report.built_from);
    object["layer_version"] = report.layer_version;
  }
  object["zooms"] = nlohmann::ordered_json::array();
  for (const BuiltZoom& zoom : report.zooms) object["zooms"].push_back(zoom_object(zoom));
  return object.dump(2) + "\n";
}

std::string report_table(const BuildReport& report) {
  std::string text =
      fmt::format("{:>4} {:>9} {:>9} {:>9} {:>12} {:>12} {:>12} {:>12}\n", "zoom", "tiles",
                  "mean V", "mean T", "bytes", "tolerance m", "max error m", "RMS error m");
  for (const BuiltZoom& zoom : report.zooms) {
    const auto tiles = static_cast<double>(std::max<std::int64_t>(1, zoom.tiles));
    text += fmt::format("{:>4} {:>9} {:>9.1f} {:>9.1f} {:>12} {:>12} {:>12.3f} {:>12.3f}\n",
                        zoom.zoom, zoom.tiles, static_cast<double>(zoom.vertices) / tiles,
                        static_cast<double>(zoom.triangles) / tiles, zoom.stored_bytes,
                        zoom.tolerance_m ? fmt::format("{:.3f}", *zoom.tolerance_m) : "none",
                        zoom.error.largest_m, zoom.error.rms_m());
  }
  double largest_m = 0;
  for (const BuiltZoom& zoom : report.zooms) {
    largest_m = std::max(largest_m, zoom.tolerance_m.value_or(0));
  }
  return text + coarse_zooms_text(largest_m);
}

std::string coarse_zooms_text(double largest_tolerance_m) {
  constexpr double kToBeExplained_m = 1000;
  if (largest_tolerance_m < kToBeExplained_m) return "";
  return "Errors of kilometres at coarse zooms are meant: the tolerance halves with each zoom, "
         "and\n"
         "viewers show a coarse one only from where that is less than a pixel or two (CesiumJS "
         "counts\n"
         "with 77 km at zoom 0). For finer ones give --tolerance 1000, or --tolerance-at "
         "0=500,1=500.\n";
}

std::string source_reads_text(const SourceReads& reads) {
  return fmt::format("{} blocks, each decoded {:.2f} times", reads.blocks,
                     reads.decoded_per_block());
}

}  // namespace qmpipe
