// `qmpipe check`: does a tile set work for viewers, as a web server serves it?
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs;
// its result is the exit code: 0 when no fault was found, 3 when there is one (warnings and hints do
// not count), 1 when nobody answers. It throws UsageError and Interrupted. REQUIRES: `action`
// outlives the parsing.
void register_check(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
