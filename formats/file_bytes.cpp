#include "formats/file_bytes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <string>
#include <system_error>
#include <utility>

#include "formats/errors.h"

namespace qmpipe {
namespace {

std::string text_of_errno(int error_number) {
  return std::generic_category().message(error_number);
}

class FileHandle {
 public:
  explicit FileHandle(int descriptor) : descriptor_(descriptor) {}
  ~FileHandle() {
    if (is_open()) ::close(descriptor_);
  }
  FileHandle(const FileHandle&) = delete;
  FileHandle& operator=(const FileHandle&) = delete;

  bool is_open() const { return descriptor_ >= 0; }
  int descriptor() const { return descriptor_; }
  // Network file systems report a full disk only here. 0 or errno.
  int close() { return ::close(std::exchange(descriptor_, -1)) == 0 ? 0 : errno; }

 private:
  int descriptor_;
};

// 0 or errno.
int write_all(int descriptor, std::span<const std::uint8_t> bytes) {
  while (!bytes.empty()) {
    const ssize_t written = ::write(descriptor, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return errno;
    bytes = bytes.subspan(static_cast<std::size_t>(written));
  }
  return 0;
}

// 0 or errno.
int write_and_close(const std::string& path, std::span<const std::uint8_t> bytes) {
  FileHandle file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file.is_open()) return errno;
  if (const int error = write_all(file.descriptor(), bytes); error != 0) return error;
  return file.close();
}

}  // namespace

std::string remedy_for_errno(int error_number) {
  switch (error_number) {
    case ENOSPC:
    case EDQUOT:
      return "Free some space or choose another disk.";
    case EFBIG:
      return "Raise the limit on file sizes (ulimit -f) or choose another disk.";
    case EACCES:
    case EPERM:
      return "Check the permissions of the folder, or choose another one.";
    case EROFS:
      return "The disk is read-only; choose another one.";
    case ENOTDIR:
    case EISDIR:
    case EEXIST:
      return "A file stands where a folder is wanted, or the other way round; choose another path.";
    case EMFILE:
    case ENFILE:
      return "Raise the limit on open files (ulimit -n).";
    case EIO:
      return "The disk reports a fault; check it, or choose another one.";
    default:
      return "";
  }
}

void write_file_atomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  const std::string temporary = path.string() + kTemporarySuffix;
  int error = write_and_close(temporary, bytes);
  if (error == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error == 0) return;
  ::unlink(temporary.c_str());
  throw IoError("cannot write", path.string(), text_of_errno(error), remedy_for_errno(error));
}

Result<std::vector<std::uint8_t>> read_file_bytes(const std::filesystem::path& path,
                                                  std::size_t limit_bytes) {
  const auto failed = [&path](const std::string& cause) {
    return Error{fmt::format("cannot read {}: {}", path.string(), cause)};
  };
  // Not blocking, so that a named pipe is refused below instead of waited for.
  const FileHandle file(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  if (!file.is_open()) return failed(text_of_errno(errno));
  struct stat status {};
  if (::fstat(file.descriptor(), &status) != 0) return failed(text_of_errno(errno));
  if (!S_ISREG(status.st_mode)) return failed("it is no regular file");
  if (std::cmp_greater(status.st_size, limit_bytes)) {
    return failed(
        fmt::format("it has {} bytes, more than the {} allowed here", status.st_size, limit_bytes));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(status.st_size));
  std::size_t at = 0;
  while (at < bytes.size()) {
    const ssize_t got = ::read(file.descriptor(), bytes.data() + at, bytes.size() - at);
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return failed(text_of_errno(errno));
    if (got == 0) return failed(fmt::format("it ends at byte {} of {}", at, bytes.size()));
    at += static_cast<std::size_t>(got);
  }
  return bytes;
}

}  // namespace qmpipe
