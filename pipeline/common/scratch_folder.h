// A folder for what a run without checkpoints keeps on disk while it works; removed when it ends.
#pragma once

#include <filesystem>

namespace qmpipe {

class ScratchFolder {
 public:
  // `base`-PID; without a base, where the system keeps temporary files. Throws IoError.
  explicit ScratchFolder(const std::filesystem::path& base);
  ~ScratchFolder();
  ScratchFolder(const ScratchFolder&) = delete;
  ScratchFolder& operator=(const ScratchFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace qmpipe
