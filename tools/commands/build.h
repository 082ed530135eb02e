// `qmpipe build`: from rasters to a finished tile set.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand; when it is given on the command line, `action` becomes its run. The action
// throws UsageError, IoError and Interrupted.
void register_build(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
