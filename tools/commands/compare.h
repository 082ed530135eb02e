// `qmpipe compare`: which simplification method suits a DEM? The evaluation of Campos et al. 2020,
// section 5, as a report.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs;
// its result is the exit code: 0 when the report is written, 3 when verification found a fault in
// one of the pyramids. It throws UsageError, IoError and Interrupted. REQUIRES: `action` outlives
// the parsing.
void register_compare(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
