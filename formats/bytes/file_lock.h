// One process at a time has a file. The system's lock goes with the process, however it ends; some file
// systems have none (Lustre without -o flock, NFS without its lock daemon), and there a lock file stands
// beside the file instead: FILE.lock, made exclusively, with host and process in it.
//
// Guarantees: of two processes that take a lock, on one machine or two, one gets it. A lock file that a
// killed process has left is never taken over, since nobody can tell that from one on another machine or
// in another container: the error says whose it is and how to remove it.
#pragma once

#include <filesystem>
#include <memory>
#include <string>

namespace qmpipe {

// Stands as long as it lives.
class LockFile {
 public:
  // Makes FILE.lock. Throws IoError, which says "another run is at work", when it is there.
  static std::unique_ptr<LockFile> make(const std::filesystem::path& file);
  ~LockFile();
  LockFile(const LockFile&) = delete;
  LockFile& operator=(const LockFile&) = delete;

 private:
  LockFile(std::filesystem::path path, std::string holder);

  const std::filesystem::path path_;
  const std::string holder_;
};

// Locks the file that is open, until the descriptor is closed; where its file system has no locks, by a
// lock file, which is returned. Throws IoError when another process has it.
std::unique_ptr<LockFile> lock_open_file(int descriptor, const std::filesystem::path& file);

// What a file system without locks answers to the wish for one.
bool means_no_locks(int error_number);

}  // namespace qmpipe
