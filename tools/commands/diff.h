// `qmpipe diff`: how two tile sets differ.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs;
// its result is the exit code: 0 the same, 3 different. It throws IoError and Interrupted.
// REQUIRES: `action` outlives the parsing.
void register_diff(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
