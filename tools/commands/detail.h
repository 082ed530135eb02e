// `qmpipe detail`: detail-increment models, built, looked into, checked, and extracted at any scale
// (Ai et al. 2019).
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand with its own subcommands to `app`. When the arguments ask for one, `action` is set
// to what main() runs; its result is the exit code (verify: 3 when there is a fault). It throws
// UsageError, IoError and Interrupted. REQUIRES: `action` outlives the parsing.
void register_detail(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
