// `qmpipe synth`: writes a made-up DEM of any size, for trials, demos and benchmarks.
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
}

namespace qmpipe {

struct SynthOptions {
  std::string output;
  std::string size = "4096x2048";                         // columns x rows
  std::vector<double> bounds_deg = {-180, -90, 180, 90};  // west, south, east, north: outer edges
  std::uint32_t seed = 1;
  double void_share = 0;
  bool overwrite = false;
};

// Returns the exit code. Throws UsageError for options that make no sense, IoError when the file
// cannot be written.
int run_synth(const SynthOptions& options);

// Adds the subcommand; when it is given on the command line, `action` becomes its run.
void register_synth(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
