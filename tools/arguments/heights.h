// The options about what the numbers of rasters mean, the same for every command that reads DEMs.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "formats/heights/tally.h"
#include "formats/raster/height_options.h"

namespace CLI {
class App;
}

namespace qmpipe {

// The words as typed, before they are understood.
struct HeightArguments {
  std::string voids;
  std::optional<std::int32_t> band;
  std::string encoding;
  std::vector<std::string> open_options;
  std::vector<std::string> config;
  std::optional<double> z_scale;
  std::optional<double> z_offset_m;
  bool allow_heights = false;
};

void add_height_options(CLI::App& command, HeightArguments& arguments);
// Whether heights that Earth does not have end the run.
void add_height_guard(CLI::App& command, HeightArguments& arguments);

// Throws UsageError. Sets GDAL's configuration: to be called before anything is opened.
HeightOptions to_height_options(const HeightArguments& arguments);
// For -v.
std::string heights_text(const HeightOptions& options);
HeightGuard to_height_guard(const HeightArguments& arguments);

}  // namespace qmpipe
