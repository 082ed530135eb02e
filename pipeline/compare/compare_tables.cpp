#include "pipeline/compare/compare_tables.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

namespace qmpipe {
namespace {

using nlohmann::ordered_json;

double mean_of(double sum, std::int64_t count) {
  return count == 0 ? 0 : sum / static_cast<double>(count);
}

std::string parameters_text(const ParameterValues& values) {
  std::string text;
  for (const auto& [name, value] : values) {
    text += fmt::format("{}{}={:g}", text.empty() ? "" : " ", name, value);
  }
  return text;
}

double simplify_seconds(const BuiltZoom& zoom) {
  return zoom.seconds[static_cast<std::size_t>(Stage::kMesh)];
}

ordered_json zoom_json(const ComparedZoom& zoom) {
  return {{"zoom", zoom.zoom},
          {"tiles", zoom.tiles},
          {"full_tiles", zoom.full_tiles},
          {"mean_vertices", zoom.mean_vertices},
          {"mean_triangles", zoom.mean_triangles},
          {"mean_bytes", zoom.mean_bytes},
          {"mean_tile_ms", zoom.mean_tile_ms},
          {"max_error_m", zoom.largest_error_m},
          {"rms_error_m", zoom.rms_error_m},
          {"mean_hausdorff_m", zoom.hausdorff_m},
          {"mean_points_hausdorff_m", zoom.points_hausdorff_m},
          {"hausdorff_m", zoom.sorted_hausdorff_m}};
}

ordered_json trial_json(const TileTrial& trial) {
  return {{"parameters", trial.parameters},
          {"seconds", trial.seconds},
          {"vertices", trial.tin.vertices.size()},
          {"triangles", trial.tin.triangle_count()},
          {"max_error_m", trial.error.largest_m},
          {"rms_error_m", trial.error.rms_m()},
          {"hausdorff_m", trial.hausdorff.to_surfaces_m},
          {"points_hausdorff_m", trial.hausdorff.between_points_m}};
}

}  // namespace

std::vector<ComparedZoom> zooms_of(const ComparedMethod& method) {
  std::vector<ComparedZoom> zooms;
  for (const BuiltZoom& built : method.build.zooms) {
    ComparedZoom& zoom = zooms.emplace_back();
    zoom.zoom = built.zoom;
    zoom.tiles = built.tiles;
    zoom.mean_bytes = mean_of(static_cast<double>(built.stored_bytes), built.tiles);
    zoom.mean_tile_ms = mean_of(1000 * simplify_seconds(built), built.tiles);
    const auto found = std::find_if(
        method.verify.zooms.begin(), method.verify.zooms.end(),
        [&built](const verify::ZoomReport& report) { return report.zoom == built.zoom; });
    if (found == method.verify.zooms.end()) continue;
    zoom.largest_error_m = found->error.largest_m;
    zoom.rms_error_m = found->error.rms_m();
    zoom.full_tiles = std::ssize(found->measured);
    double vertices = 0;
    double triangles = 0;
    for (const verify::MeasuredTile& tile : found->measured) {
      vertices += static_cast<double>(tile.vertices);
      triangles += static_cast<double>(tile.triangles);
      zoom.sorted_hausdorff_m.push_back(tile.hausdorff.to_surfaces_m);
    }
    zoom.mean_vertices = mean_of(vertices, zoom.full_tiles);
    zoom.mean_triangles = mean_of(triangles, zoom.full_tiles);
    zoom.hausdorff_m = found->mean_hausdorff().to_surfaces_m;
    zoom.points_hausdorff_m = found->mean_hausdorff().between_points_m;
    std::sort(zoom.sorted_hausdorff_m.begin(), zoom.sorted_hausdorff_m.end());
  }
  return zooms;
}

std::string single_tile_csv(const Comparison& comparison) {
  std::string text =
      "method,parameters,run_time_s,vertices,triangles,max_error_m,rms_error_m,hausdorff_m\n";
  for (const ComparedMethod& method : comparison.methods) {
    if (!method.trial) continue;
    const TileTrial& trial = *method.trial;
    text += fmt::format("{},{},{:.6g},{},{},{:.6g},{:.6g},{:.6g}\n", name_of(method.choice),
                        parameters_text(trial.parameters), trial.seconds, trial.tin.vertices.size(),
                        trial.tin.triangle_count(), trial.error.largest_m, trial.error.rms_m(),
                        trial.hausdorff.to_surfaces_m);
  }
  return text;
}

std::string zooms_csv(const Comparison& comparison) {
  std::string text =
      "method,zoom,full_tiles,tiles,mean_vertices,mean_triangles,mean_hausdorff_m,"
      "mean_points_hausdorff_m,max_error_m,rms_error_m,mean_bytes,mean_tile_ms\n";
  for (const ComparedMethod& method : comparison.methods) {
    for (const ComparedZoom& zoom : zooms_of(method)) {
      text += fmt::format("{},{},{},{},{:.2f},{:.2f},{:.6g},{:.6g},{:.6g},{:.6g},{:.1f},{:.4g}\n",
                          name_of(method.choice), zoom.zoom, zoom.full_tiles, zoom.tiles,
                          zoom.mean_vertices, zoom.mean_triangles, zoom.hausdorff_m,
                          zoom.points_hausdorff_m, zoom.largest_error_m, zoom.rms_error_m,
                          zoom.mean_bytes, zoom.mean_tile_ms);
    }
  }
  return text;
}

std::string run_times_csv(const Comparison& comparison) {
  std::string text = "method,threads,survey_s,mesh_s,total_s,tiles,bytes,faults\n";
  for (const ComparedMethod& method : comparison.methods) {
    const BuildReport& build = method.build;
    text += fmt::format("{},{},{:.3f},{:.3f},{:.3f},{},{},{}\n", name_of(method.choice),
                        build.threads, build.survey_s, build.mesh_s, build.survey_s + build.mesh_s,
                        build.tiles, build.stored_bytes, method.verify.fault_count);
  }
  return text;
}

std::string distances_csv(const Comparison& comparison) {
  std::string text = "method,zoom,rank,hausdorff_m\n";
  for (const ComparedMethod& method : comparison.methods) {
    for (const ComparedZoom& zoom : zooms_of(method)) {
      for (std::size_t k = 0; k < zoom.sorted_hausdorff_m.size(); ++k) {
        text += fmt::format("{},{},{},{:.6g}\n", name_of(method.choice), zoom.zoom, k + 1,
                            zoom.sorted_hausdorff_m[k]);
      }
    }
  }
  return text;
}

std::string comparison_json(const Comparison& comparison) {
  ordered_json object = {{"inputs", comparison.inputs}, {"threads", comparison.threads}};
  object["tile"] = comparison.tile ? ordered_json(to_string(*comparison.tile)) : nullptr;
  object["methods"] = ordered_json::array();
  for (const ComparedMethod& method : comparison.methods) {
    ordered_json one = {{"method", name_of(method.choice)},
                        {"survey_s", method.build.survey_s},
                        {"mesh_s", method.build.mesh_s},
                        {"tiles", method.build.tiles},
                        {"bytes", method.build.stored_bytes},
                        {"faults", method.verify.fault_count},
                        {"largest_crack_m", method.verify.largest_crack_m}};
    one["single_tile"] = method.trial ? trial_json(*method.trial) : nullptr;
    one["zooms"] = ordered_json::array();
    for (const ComparedZoom& zoom : zooms_of(method)) one["zooms"].push_back(zoom_json(zoom));
    object["methods"].push_back(std::move(one));
  }
  return object.dump(2) + "\n";
}

}  // namespace qmpipe
