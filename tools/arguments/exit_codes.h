// What the program ends with beside 0 (done), 1 (failed), 2 (usage) and 130 (interrupted), which main()
// gives for all commands.
#pragma once

namespace qmpipe {

// A command that looks for faults has found some.
inline constexpr int kExitFaults = 3;

}  // namespace qmpipe
