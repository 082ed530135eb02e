// `qmpipe tin`: one DEM as one TIN in a mesh file, with its statistics.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs. It
// throws UsageError and IoError. REQUIRES: `action` outlives the parsing.
void register_tin(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
