// A file that a fuzz target gives to a reader which takes a path. It lies in memory where the system
// has such a folder, and is removed at the end.
#pragma once

#include <unistd.h>

#include <cstdint>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <span>
#include <string>

namespace qmpipe::fuzz {

class FileInMemory {
 public:
  explicit FileInMemory(const std::string& extension)
      : path_((std::filesystem::is_directory("/dev/shm") ? std::filesystem::path("/dev/shm")
                                                         : std::filesystem::temp_directory_path()) /
              ("qmpipe-fuzz-" + std::to_string(::getpid()) + extension)) {}
  ~FileInMemory() {
    std::error_code ignored;
    std::filesystem::remove(path_, ignored);
  }
  FileInMemory(const FileInMemory&) = delete;
  FileInMemory& operator=(const FileInMemory&) = delete;

  const std::filesystem::path& path() const { return path_; }
  void put(std::span<const std::uint8_t> bytes) const {
    std::ofstream file(path_, std::ios::binary | std::ios::trunc);
    file.write(reinterpret_cast<const char*>(bytes.data()),
               static_cast<std::streamsize>(bytes.size()));
    if (!file.flush()) std::abort();
  }

 private:
  std::filesystem::path path_;
};

}  // namespace qmpipe::fuzz
