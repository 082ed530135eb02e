// A folder for what a run keeps on disk while it works: beside the output, named after it, removed
// when the run ends.
#pragma once

#include <filesystem>

namespace qmpipe {

class RunFolder {
 public:
  // OUT.qmpipe-run; what an earlier run that was killed has left there is removed. Without an output
  // (a dry run) the folder is made where the system keeps temporary files. Throws IoError.
  explicit RunFolder(const std::filesystem::path& output);
  ~RunFolder();
  RunFolder(const RunFolder&) = delete;
  RunFolder& operator=(const RunFolder&) = delete;

  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace qmpipe
