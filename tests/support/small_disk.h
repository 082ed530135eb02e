// A disk of 2 MiB at a folder, for tests of what happens when it is full.
#pragma once

#include <sys/mount.h>

#include <filesystem>
#include <utility>

namespace qmpipe::testing {

// Needs the right to mount (root); is_mounted() says whether it was there.
class SmallDisk {
 public:
  explicit SmallDisk(std::filesystem::path folder) : folder_(std::move(folder)) {
    is_mounted_ = ::mount("tmpfs", folder_.c_str(), "tmpfs", 0, "size=2m") == 0;
  }
  ~SmallDisk() {
    if (is_mounted_) ::umount(folder_.c_str());
  }
  SmallDisk(const SmallDisk&) = delete;
  SmallDisk& operator=(const SmallDisk&) = delete;
  bool is_mounted() const { return is_mounted_; }

 private:
  std::filesystem::path folder_;
  bool is_mounted_ = false;
};

}  // namespace qmpipe::testing
