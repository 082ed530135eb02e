#include "pipeline/common/machine_share.h"

#include <sched.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <fstream>
#include <memory>
#include <sstream>
#include <string>
#include <thread>

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr const char* kMembership = "/proc/self/cgroup";
constexpr const char* kRoot = "/sys/fs/cgroup";

template <class Value>
void take_less(std::optional<Value>& limit, Value value) {
  limit = limit ? std::min(*limit, value) : value;
}

// The whole numbers at the beginning of a file: two in cpu.max, one in the others; "max" is none.
std::optional<double> number_in(const fs::path& file, int place = 0) {
  std::ifstream in(file);
  double value = 0;
  for (int k = 0; k <= place; ++k) in >> value;
  return in && std::isfinite(value) ? std::optional(value) : std::nullopt;
}

void take_processors(CgroupLimits& limits, std::optional<double> quota,
                     std::optional<double> period) {
  // Version 1 writes -1 for no quota.
  if (quota && period && *quota > 0 && *period > 0) {
    take_less(limits.processors, *quota / *period);
  }
}

void take_memory(CgroupLimits& limits, std::optional<double> bytes) {
  // Version 1 writes a number near 2^63 for no limit.
  if (bytes && *bytes > 0 && *bytes < 0x1p60) {
    take_less(limits.memory_bytes, static_cast<std::int64_t>(*bytes));
  }
}

// `visit` with the group's folder and with all above it, the root last.
template <class Visit>
void for_each_group(const fs::path& root, const std::string& group, const Visit& visit) {
  fs::path path = fs::path(group).relative_path().lexically_normal();
  // Outside of what a namespace shows.
  if (!path.empty() && *path.begin() == "..") path.clear();
  for (; !path.empty() && path != "."; path = path.parent_path()) visit(root / path);
  visit(root);
}

void read_version_2(CgroupLimits& limits, const fs::path& root, const std::string& group) {
  for_each_group(root, group, [&limits](const fs::path& folder) {
    take_processors(limits, number_in(folder / "cpu.max"), number_in(folder / "cpu.max", 1));
    take_memory(limits, number_in(folder / "memory.max"));
  });
}

void read_version_1(CgroupLimits& limits, const fs::path& root, const std::string& group) {
  for_each_group(root, group, [&limits](const fs::path& folder) {
    take_processors(limits, number_in(folder / "cpu.cfs_quota_us"),
                    number_in(folder / "cpu.cfs_period_us"));
    take_memory(limits, number_in(folder / "memory.limit_in_bytes"));
  });
}

std::int32_t processors_of_affinity() {
  // Machines may have more processors than a cpu_set_t has places.
  for (std::size_t places = 1024; places <= 1U << 20U; places *= 2) {
    const auto set = std::unique_ptr<cpu_set_t, void (*)(cpu_set_t*)>(
        CPU_ALLOC(places), [](cpu_set_t* given) { CPU_FREE(given); });
    if (!set) break;
    const std::size_t bytes = CPU_ALLOC_SIZE(places);
    if (::sched_getaffinity(0, bytes, set.get()) != 0) continue;
    return CPU_COUNT_S(bytes, set.get());
  }
  return static_cast<std::int32_t>(std::thread::hardware_concurrency());
}

}  // namespace

CgroupLimits cgroup_limits(const fs::path& membership, const fs::path& root) {
  CgroupLimits limits;
  std::ifstream lines(membership);
  // "number:controllers:group"; version 2 has number 0 and no controllers.
  for (std::string line; std::getline(lines, line);) {
    const std::size_t first = line.find(':');
    const std::size_t second = line.find(':', first + 1);
    if (first == std::string::npos || second == std::string::npos) continue;
    const std::string controllers = line.substr(first + 1, second - first - 1);
    const std::string group = line.substr(second + 1);
    if (controllers.empty()) {
      read_version_2(limits, root, group);
      // Where version 1 has the rest.
      read_version_2(limits, root / "unified", group);
      continue;
    }
    std::istringstream names(controllers);
    for (std::string name; std::getline(names, name, ',');) {
      if (name != "cpu" && name != "memory") continue;
      read_version_1(limits, root / controllers, group);
      if (name != controllers) read_version_1(limits, root / name, group);
    }
  }
  return limits;
}

std::int32_t usable_threads() {
  std::int32_t threads = processors_of_affinity();
  if (const auto processors = cgroup_limits(kMembership, kRoot).processors) {
    threads = std::min(threads, static_cast<std::int32_t>(std::ceil(std::min(*processors, 1e6))));
  }
  return std::max(threads, 1);
}

std::int64_t usable_memory_bytes() {
  const auto machine = static_cast<std::int64_t>(sysconf(_SC_PHYS_PAGES)) * sysconf(_SC_PAGESIZE);
  return std::min(machine, cgroup_limits(kMembership, kRoot).memory_bytes.value_or(machine));
}

}  // namespace qmpipe
