#include "perf/cold_files.h"

#include <fcntl.h>
#include <unistd.h>

#include <stdexcept>

namespace qmpipe::perf {
namespace {

void forget_file(const std::filesystem::path& path) {
  const int file = ::open(path.c_str(), O_RDONLY);
  // Pages that wait to be written cannot be dropped.
  const bool is_done =
      file >= 0 && ::fdatasync(file) == 0 && ::posix_fadvise(file, 0, 0, POSIX_FADV_DONTNEED) == 0;
  if (file >= 0) ::close(file);
  if (!is_done) throw std::runtime_error("benchmark: cannot drop the cache of " + path.string());
}

}  // namespace

void forget_cached_pages(const std::filesystem::path& path) {
  if (!std::filesystem::is_directory(path)) {
    forget_file(path);
    return;
  }
  for (const auto& entry : std::filesystem::directory_iterator(path)) forget_file(entry.path());
}

}  // namespace qmpipe::perf
