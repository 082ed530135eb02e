// The simplification methods and their parameters by the names of Campos et al. 2020, Table 1, for each
// zoom (section 4.4.3).
#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <map>
#include <span>
#include <string>
#include <variant>
#include <vector>

#include "formats/bytes/result.h"
#include "stages/edge_collapse/edge_collapse.h"
#include "stages/greedy/greedy.h"
#include "stages/point_sets/point_set.h"

namespace qmpipe {

enum class Method { kGreedy, kEdgeCollapse, kPsRandom, kPsGrid, kPsHierarchy, kPsWlop };
inline constexpr std::array kMethods = {Method::kGreedy, Method::kEdgeCollapse, Method::kPsRandom,
                                        Method::kPsGrid, Method::kPsHierarchy,  Method::kPsWlop};

// What ends edge collapse: the tolerance g_e, which then holds as it does for greedy insertion, or the
// number of edges e_e, as in the paper.
enum class Stop { kTolerance, kEdges };

// The names used on the command line and in files: "greedy", "edge-collapse", "ps-random" ...;
// "tolerance", "edges".
std::string name_of(Method method);
std::string name_of(Stop stop);
Result<Method> method_named(const std::string& name);
Result<Stop> stop_named(const std::string& name);

// True where every post ends within the tolerance.
bool has_error_bound(Method method, Stop stop);

// One parameter over the zooms: values from zoom 0 on; deeper zooms take the last one times
// `factor` for each zoom.
class ZoomSeries {
 public:
  // REQUIRES: at least one value.
  explicit ZoomSeries(std::vector<double> values, double factor = 1);
  double at(std::int32_t zoom) const;
  const std::vector<double>& values() const { return values_; }
  // As it is typed: "10", "15000/2" (halved at each deeper zoom), "3*2" (doubled), "5000,5000,1000"
  // (zoom 0, 1, and 2 with all deeper ones).
  std::string text() const;
  static Result<ZoomSeries> parse(const std::string& text);
  friend bool operator==(const ZoomSeries&, const ZoomSeries&) = default;

 private:
  std::vector<double> values_;
  double factor_ = 1;
};

struct ParameterInfo {
  const char* name;     // "g_e"
  const char* meaning;  // with the unit
  const char* default_text;
  double least;
  double most;
  bool whole;  // no fractions
};

// All parameters there are, and those that a method uses, in the order of Table 1.
std::span<const ParameterInfo> all_parameters();
std::vector<ParameterInfo> parameters_of(Method method, Stop stop);

// A value for every parameter; those of Table 3 unless set. (But g_g is 0, because the curvature of
// the globe is part of our error and puts vertices where they are needed.)
class MethodParameters {
 public:
  MethodParameters();
  // REQUIRES: a name of all_parameters().
  const ZoomSeries& of(const std::string& name) const;
  // Throws UsageError that names the parameter when there is none of the name, or a listed value is
  // out of its range.
  void set(const std::string& name, const ZoomSeries& series);
  friend bool operator==(const MethodParameters&, const MethodParameters&) = default;

 private:
  std::map<std::string, ZoomSeries> series_;
};

// A file of parameters: a JSON object with a number, a list or a text as above for each name; comments
// are allowed. Throws IoError when it cannot be read, UsageError when it cannot be understood.
void read_parameter_file(const std::string& path, MethodParameters& parameters);

// By name, for one zoom: parameters_of(method, stop).
using ParameterValues = std::map<std::string, double>;

// The values at a zoom. Throws UsageError when one is out of its range there.
ParameterValues values_at(const MethodParameters& parameters, Method method, Stop stop,
                          std::int32_t zoom);

// One zoom's values for the stages. REQUIRES: a value for each of parameters_of(method, stop).
struct MethodFrame {
  HeightSteps height_steps = {};
  double side_depth_m = std::numeric_limits<double>::infinity();
  Curvature curvature = Curvature::kCounts;
  std::uint64_t seed = 0;  // of all that is random
};
using MethodOptions = std::variant<GreedyOptions, EdgeCollapseOptions, PointSetOptions>;
MethodOptions method_options(Method method, Stop stop, const ParameterValues& values,
                             const MethodFrame& frame);

// What a tile takes while it is simplified, beyond what it takes in flight (measured).
std::int64_t simplify_bytes(Method method);

// What a tile usually takes of one core, in seconds (measured; DEMs differ by a factor of three).
double usual_tile_s(Method method);

Tin simplify(const PostGrid& grid, std::span<const float> heights_m, const FixedBorders& fixed,
             const MethodOptions& options);

}  // namespace qmpipe
