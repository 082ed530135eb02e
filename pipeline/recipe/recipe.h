// Everything that decides a tile set's bytes besides the input: written into layer.json under the
// key "qmpipe", so that `verify` can recompute the posts and a later run can tell whether it would
// continue the same work. Threads, memory and sinks are not in it, because bytes do not depend on
// them.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/raster/height_options.h"
#include "pipeline/recipe/method.h"
#include "scheduler/tiling_scheme.h"
#include "stages/posts/height_step.h"
#include "stages/posts/heightfield.h"
#include "stages/posts/reduce.h"
#include "stages/posts/sampling.h"

namespace qmpipe {

struct Recipe {
  std::string program_version;
  Projection projection = Projection::kGeodetic;
  std::int32_t sampling_zoom = 0;
  std::int32_t min_zoom = 0;
  std::int32_t max_zoom = 0;
  std::string source_crs;  // in place of the inputs' own; empty: their own
  HeightOptions heights;   // likewise
  Resampling resampling = Resampling::kBilinear;
  Reduction reduction = Reduction::kMean;
  VoidPolicy voids;
  Method method = Method::kGreedy;
  Stop stop = Stop::kTolerance;
  // By zoom, 0..max_zoom. A bound of the error where has_error_bound(), else the scale of the heights.
  std::vector<double> tolerance_m;
  // Of vertices on sides; a tile's inner ones may have a part of it (tile_steps).
  std::vector<double> height_step_m;
  // The method's own parameters but g_e, by zoom.
  std::map<std::string, std::vector<double>> parameters;
  bool normals = true;

  std::optional<double> error_bound_m(std::int32_t zoom) const;
  // The method's parameters with g_e. REQUIRES: 0 <= zoom <= max_zoom.
  ParameterValues parameters_at(std::int32_t zoom) const;
  // How deep a chord of a side may sink below the globe: a quarter of the tolerance, so that a client's
  // skirts, which are as deep as a zoom's error, hide what opens beside a finer zoom.
  double side_depth_m(std::int32_t zoom) const;
  // The steps of a tile whose posts, voids filled, are these. REQUIRES: the same.
  HeightSteps steps_for(std::int32_t zoom, std::span<const float> heights_m) const;
  // What is random comes from the key. REQUIRES: the same of key.zoom.
  MethodOptions options_for(const TileKey& key, const HeightSteps& steps) const;
  friend bool operator==(const Recipe&, const Recipe&) = default;
};

// The names used on the command line and in files.
std::string name_of(Resampling resampling);
std::string name_of(Reduction reduction);
// "pull", "pull=D", "height=H" or "omit"; a base zoom is not in it.
std::string name_of(const VoidPolicy& policy);
Result<Resampling> resampling_named(const std::string& name);
Result<Reduction> reduction_named(const std::string& name);
Result<VoidPolicy> void_policy_named(const std::string& name);

// JSON text of an object, keys sorted; read back equal.
std::string write_recipe(const Recipe& recipe);
Result<Recipe> parse_recipe(const std::string& text);

}  // namespace qmpipe
