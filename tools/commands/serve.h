// `qmpipe serve`: a tile set on a web server of its own, with a page that shows it.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs,
// which serves until it is interrupted; its result is the exit code. It throws UsageError and
// IoError. REQUIRES: `action` outlives the parsing.
void register_serve(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
