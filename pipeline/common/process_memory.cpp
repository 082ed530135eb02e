#include "pipeline/common/process_memory.h"

#include <malloc.h>
#include <sys/resource.h>

#include "pipeline/common/machine_share.h"

namespace qmpipe {

std::int64_t memory_limit_bytes(std::int64_t wanted_bytes) {
  if (wanted_bytes > 0) return wanted_bytes;
  return usable_memory_bytes() / 10 * 9;
}

std::int64_t peak_resident_bytes() {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  // glibc declares the field inside a union.
  // NOLINTNEXTLINE(cppcoreguidelines-pro-type-union-access)
  return static_cast<std::int64_t>(usage.ru_maxrss) * 1024;
}

void give_back_freed_memory() { malloc_trim(0); }

}  // namespace qmpipe
