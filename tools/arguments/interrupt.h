// Ctrl-C and SIGTERM as a flag that a run looks at.
#pragma once

#include <atomic>

namespace qmpipe {

// Sets the handlers on the first call. A second signal ends the process at once, for whoever does
// not want to wait for the tiles in flight.
const std::atomic<bool>* stop_flag_of_signals();

}  // namespace qmpipe
