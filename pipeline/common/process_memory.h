// The memory of this process, as the system sees it.
#pragma once

#include <cstdint>

namespace qmpipe {

// What the user allows, or nine tenths of what the process may use of the machine's memory
// (pipeline/common/machine_share.h) where that is 0: running out of it would end the process without a word.
std::int64_t memory_limit_bytes(std::int64_t wanted_bytes);

// The most that was resident so far.
std::int64_t peak_resident_bytes();

// Gives what was freed back to the system, where the C library can: between two passes, so that the
// second does not come on top of what the first has left.
void give_back_freed_memory();

}  // namespace qmpipe
