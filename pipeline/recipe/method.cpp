#include "pipeline/recipe/method.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>

namespace qmpipe {
namespace {

struct MethodInfo {
  Method method;
  const char* name;
  // Names of its parameters, or the first letters of them.
  std::vector<std::string_view> parameters;
};

const std::vector<MethodInfo>& method_table() {
  static const std::vector<MethodInfo> kTable = {
      {Method::kGreedy, "greedy", {"g_e", "g_g"}},
      {Method::kEdgeCollapse, "edge-collapse", {"e_v", "e_b", "e_s"}},
      {Method::kPsRandom, "ps-random", {"p_e", "p_b", "p_m", "r_r"}},
      {Method::kPsGrid, "ps-grid", {"p_e", "p_b", "p_m", "d_g"}},
      {Method::kPsHierarchy, "ps-hierarchy", {"p_e", "p_b", "p_m", "h_c", "h_v"}},
      {Method::kPsWlop, "ps-wlop", {"p_e", "p_b", "p_m", "w_p", "w_r", "w_i"}}};
  return kTable;
}

const MethodInfo& info_of(Method method) {
  const auto& table = method_table();
  return *std::find_if(table.begin(), table.end(),
                       [method](const MethodInfo& info) { return info.method == method; });
}

PointSetMethod point_set_method(Method method) {
  switch (method) {
    case Method::kPsGrid:
      return PointSetMethod::kGrid;
    case Method::kPsHierarchy:
      return PointSetMethod::kHierarchy;
    case Method::kPsWlop:
      return PointSetMethod::kWlop;
    case Method::kPsRandom:
    case Method::kGreedy:
    case Method::kEdgeCollapse:
      break;
  }
  return PointSetMethod::kRandom;
}

// Values of a method's own parameters; what it does not have keeps the default.
class Values {
 public:
  explicit Values(const ParameterValues& values) : values_(values) {}
  template <class Number>
  void read(const char* name, Number& into) const {
    const auto found = values_.find(name);
    if (found != values_.end()) into = static_cast<Number>(found->second);
  }

 private:
  const ParameterValues& values_;
};

GreedyOptions greedy_options(const Values& values, const MethodFrame& frame) {
  GreedyOptions options{.height_steps = frame.height_steps,
                        .side_depth_m = frame.side_depth_m,
                        .curvature = frame.curvature};
  values.read("g_e", options.tolerance_m);
  values.read("g_g", options.initial_grid_cells);
  return options;
}

EdgeCollapseOptions edge_collapse_options(Stop stop, const Values& values,
                                          const MethodFrame& frame) {
  EdgeCollapseOptions options;
  options.height_steps = frame.height_steps;
  options.side_depth_m = frame.side_depth_m;
  options.curvature = frame.curvature;
  if (stop == Stop::kTolerance) {
    values.read("g_e", options.tolerance_m.emplace(0));
  } else {
    values.read("e_e", options.least_edges);
  }
  values.read("e_v", options.volume_weight);
  values.read("e_b", options.boundary_weight);
  values.read("e_s", options.shape_weight);
  return options;
}

PointSetOptions point_set_options(Method method, const Values& values, const MethodFrame& frame) {
  PointSetOptions options{.method = point_set_method(method),
                          .height_steps = frame.height_steps,
                          .side_depth_m = frame.side_depth_m,
                          .seed = frame.seed};
  values.read("p_e", options.polyline_error_m);
  values.read("p_b", options.longest_border_edge_percent);
  values.read("p_m", options.least_polyline_points);
  values.read("r_r", options.removed_percent);
  values.read("d_g", options.cell_size_m);
  values.read("h_c", options.cluster_size);
  values.read("h_v", options.surface_variation);
  values.read("w_p", options.retained_percent);
  values.read("w_r", options.neighbour_radius_m);
  values.read("w_i", options.iterations);
  return options;
}

}  // namespace

std::string name_of(Method method) { return info_of(method).name; }

std::string name_of(Stop stop) { return stop == Stop::kTolerance ? "tolerance" : "edges"; }

Result<Method> method_named(const std::string& name) {
  std::string known;
  for (const MethodInfo& info : method_table()) {
    if (info.name == name) return info.method;
    known += (known.empty() ? "" : ", ") + std::string(info.name);
  }
  return Error{fmt::format("\"{}\" is no method; choose one of {}", name, known)};
}

Result<Stop> stop_named(const std::string& name) {
  for (const Stop stop : {Stop::kTolerance, Stop::kEdges}) {
    if (name_of(stop) == name) return stop;
  }
  return Error{fmt::format("\"{}\" is nothing to stop at; choose tolerance or edges", name)};
}

bool has_error_bound(Method method, Stop stop) {
  return method == Method::kGreedy || (method == Method::kEdgeCollapse && stop == Stop::kTolerance);
}

std::vector<ParameterInfo> parameters_of(Method method, Stop stop) {
  std::vector<std::string_view> names = info_of(method).parameters;
  if (method == Method::kEdgeCollapse) names.emplace_back(stop == Stop::kEdges ? "e_e" : "g_e");
  std::vector<ParameterInfo> parameters;
  for (const ParameterInfo& info : all_parameters()) {
    if (std::find(names.begin(), names.end(), info.name) != names.end()) parameters.push_back(info);
  }
  return parameters;
}

MethodOptions method_options(Method method, Stop stop, const ParameterValues& values,
                             const MethodFrame& frame) {
  const Values named(values);
  switch (method) {
    case Method::kGreedy:
      return greedy_options(named, frame);
    case Method::kEdgeCollapse:
      return edge_collapse_options(stop, named, frame);
    case Method::kPsRandom:
    case Method::kPsGrid:
    case Method::kPsHierarchy:
    case Method::kPsWlop:
      break;
  }
  return point_set_options(method, named, frame);
}

std::int64_t simplify_bytes(Method method) {
  switch (method) {
    case Method::kGreedy:
      return 0;
    case Method::kEdgeCollapse:
      return 40LL << 20U;
    case Method::kPsRandom:
    case Method::kPsGrid:
    case Method::kPsHierarchy:
    case Method::kPsWlop:
      break;
  }
  return 32LL << 20U;
}

double usual_tile_s(Method method) {
  switch (method) {
    case Method::kGreedy:
      return 0.02;
    case Method::kEdgeCollapse:
      return 0.5;
    case Method::kPsRandom:
    case Method::kPsGrid:
    case Method::kPsHierarchy:
    case Method::kPsWlop:
      break;
  }
  return 0.2;
}

namespace {
Tin simplify_with(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const GreedyOptions& options) {
  return greedy_insertion(grid, heights_m, fixed, options);
}
Tin simplify_with(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const EdgeCollapseOptions& options) {
  return edge_collapse(grid, heights_m, fixed, options);
}
Tin simplify_with(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
                  const PointSetOptions& options) {
  return simplify_point_set(grid, heights_m, fixed, options);
}
}  // namespace

Tin simplify(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
             const MethodOptions& options) {
  return std::visit([&](const auto& one) { return simplify_with(grid, heights_m, fixed, one); },
                    options);
}

}  // namespace qmpipe
