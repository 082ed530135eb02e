// Makes a file's next read come from the disk, for benchmarks of cold reads.
#pragma once

#include <filesystem>

namespace qmpipe::perf {

// Lets the kernel forget what it holds of a file, or of every file right under a folder. Throws
// std::runtime_error where it cannot.
void forget_cached_pages(const std::filesystem::path& path);

}  // namespace qmpipe::perf
