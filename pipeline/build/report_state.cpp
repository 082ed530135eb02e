#include "pipeline/build/report_state.h"

#include <nlohmann/json.hpp>

namespace qmpipe {
namespace {

// Calls visit(name, value) for every sum: what is written and what is read cannot differ.
template <class Zoom, class Visit>
void visit_zoom(Zoom& zoom, const Visit& visit) {
  visit("tiles", zoom.tiles);
  visit("vertices", zoom.vertices);
  visit("triangles", zoom.triangles);
  visit("plain_bytes", zoom.plain_bytes);
  visit("stored_bytes", zoom.stored_bytes);
  visit("error_posts", zoom.error.posts);
  visit("error_largest_m", zoom.error.largest_m);
  visit("error_largest_in_place_m", zoom.error.largest_in_place_m);
  visit("error_sum_m", zoom.error.sum_m);
  visit("error_sum_of_squares_m2", zoom.error.sum_of_squares_m2);
  visit("error_worst_i", zoom.error.worst.i);
  visit("error_worst_j", zoom.error.worst.j);
  for (std::size_t k = 0; k < kStageCount; ++k) visit(kStageNames[k], zoom.seconds[k]);
}

template <class Report, class Visit>
void visit_report(Report& report, const Visit& visit) {
  visit("tiles", report.tiles);
  visit("stored_bytes", report.stored_bytes);
  visit("content_hash", report.content_hash);
}

}  // namespace

std::string write_report_state(const BuildReport& report) {
  nlohmann::json object;
  const auto write_into = [](nlohmann::json& to) {
    return [&to](const char* name, const auto& value) { to[name] = value; };
  };
  visit_report(report, write_into(object));
  object["zooms"] = nlohmann::json::array();
  for (const BuiltZoom& zoom : report.zooms) {
    nlohmann::json& entry = object["zooms"].emplace_back(nlohmann::json{{"zoom", zoom.zoom}});
    visit_zoom(zoom, write_into(entry));
  }
  return object.dump();
}

Result<BuildReport> with_report_state(BuildReport into, const std::string& text) {
  const nlohmann::json object = nlohmann::json::parse(text, nullptr, false);
  if (!object.is_object() || !object.contains("zooms") || !object["zooms"].is_array() ||
      object["zooms"].size() != into.zooms.size()) {
    return Error{"its statistics do not fit the zooms of this run"};
  }
  std::string problem;
  const auto read_from = [&problem](const nlohmann::json& from) {
    return [&from, &problem](const char* name, auto& value) {
      const auto found = from.is_object() ? from.find(name) : from.end();
      if (found == from.end() || !found->is_number()) {
        problem = std::string("its statistics lack \"") + name + "\"";
        return;
      }
      found->get_to(value);
    };
  };
  visit_report(into, read_from(object));
  for (std::size_t k = 0; k < into.zooms.size(); ++k) {
    const nlohmann::json& entry = object["zooms"][k];
    std::int32_t zoom = -1;
    read_from(entry)("zoom", zoom);
    if (problem.empty() && zoom != into.zooms[k].zoom) {
      problem = "its statistics do not fit the zooms of this run";
    }
    visit_zoom(into.zooms[k], read_from(entry));
  }
  if (!problem.empty()) return Error{problem};
  return into;
}

}  // namespace qmpipe
