// `qmpipe verify`: is a finished tile set right? Any quantized-mesh set, ours or another program's.
#pragma once

#include <functional>

namespace CLI {
class App;
}

namespace qmpipe {

// Adds the subcommand to `app`. When the arguments ask for it, `action` is set to what main() runs;
// its result is the exit code: 0 when no fault was found, 3 when there is one (warnings do not
// count). It throws UsageError and IoError. REQUIRES: `action` outlives the parsing.
void register_verify(CLI::App& app, std::function<int()>& action);

}  // namespace qmpipe
