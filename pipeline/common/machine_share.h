// How much of the machine this process may use: of its processors and of its memory. A container, a batch
// system or taskset may give less than the machine has, and whoever takes more is slowed or killed.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>

namespace qmpipe {

// Processors that the process may run on (affinity), no more than the CPU time that its control groups
// allow, rounded up; at least 1.
std::int32_t usable_threads();

// The machine's memory, or the least that a control group of the process allows.
std::int64_t usable_memory_bytes();

struct CgroupLimits {
  std::optional<double> processors;
  std::optional<std::int64_t> memory_bytes;
};

// Linux control groups, version 1 and 2, also both at once: the least of the group that `membership` (as
// /proc/self/cgroup) names below `root` (as /sys/fs/cgroup) and of all above it. Groups that cannot be
// seen, as from inside a container, and values that are no numbers do not limit. Throws nothing.
CgroupLimits cgroup_limits(const std::filesystem::path& membership,
                           const std::filesystem::path& root);

}  // namespace qmpipe
