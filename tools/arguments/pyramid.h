// The options of every command that builds a pyramid: what goes in, how it is tiled, how much of the
// machine it may take.
#pragma once

#include <optional>
#include <string>

#include "pipeline/recipe/build_options.h"
#include "tools/arguments/heights.h"
#include "tools/arguments/method.h"

namespace CLI {
class App;
}

namespace qmpipe {

// The words as typed, before they are understood.
struct PyramidArguments {
  BuildOptions options;
  HeightArguments heights;
  std::string scheme = "geodetic";
  std::string resampling = name_of(Resampling::kBilinear);
  std::string reduction = name_of(Reduction::kMean);
  std::string voids = "pull";
  std::string memory = "0";
  std::string tolerances;
  // Null until they are given.
  std::optional<std::int32_t> max_zoom;
  // Shorter words for parameters.
  std::optional<double> tolerance_m;
  std::optional<double> grid_cells;
};

// --memory; to be read with parse_size().
void add_memory_option(CLI::App& command, std::string& size);
void add_pyramid_options(CLI::App& command, PyramidArguments& arguments);

// All but the method, which to_choice() gives. Throws UsageError.
BuildOptions to_build_options(const PyramidArguments& arguments);
// --tolerance and --grid.
ShortForms short_forms(const PyramidArguments& arguments);

}  // namespace qmpipe
