// `qmpipe convert`, and `pack` and `unpack`, which are the same with one form of output demanded: a
// tile set as a folder, an MBTiles or a PMTiles file.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the three subcommands to `app`. When the arguments ask for one, `action` is set to what
// main() runs; its result is the exit code. It throws UsageError, IoError and Interrupted.
// REQUIRES: `action` outlives the parsing.
void register_convert(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
