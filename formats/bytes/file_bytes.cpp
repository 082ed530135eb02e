#include "formats/bytes/file_bytes.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <cstdio>
#include <string>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"

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
  FileHandle(FileHandle&& other) noexcept : descriptor_(std::exchange(other.descriptor_, -1)) {}
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

enum class Sync { kNo, kYes };

// 0 or errno.
int write_and_close(const std::string& path, std::span<const std::uint8_t> bytes, Sync sync) {
  FileHandle file(::open(path.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (!file.is_open()) return errno;
  if (const int error = write_all(file.descriptor(), bytes); error != 0) return error;
  if (sync == Sync::kYes && ::fsync(file.descriptor()) != 0) return errno;
  return file.close();
}

// 0 or errno. A renamed file has its new name after a power cut only when its folder was synced.
int sync_folder(const std::filesystem::path& path) {
  const std::filesystem::path folder = path.has_parent_path() ? path.parent_path() : ".";
  FileHandle handle(::open(folder.c_str(), O_RDONLY | O_DIRECTORY | O_CLOEXEC));
  if (!handle.is_open() || ::fsync(handle.descriptor()) != 0) return errno;
  return handle.close();
}

void write_and_rename(const std::filesystem::path& path, std::span<const std::uint8_t> bytes,
                      Sync sync) {
  const std::string temporary = path.string() + kTemporarySuffix;
  int error = write_and_close(temporary, bytes, sync);
  if (error == 0 && ::rename(temporary.c_str(), path.c_str()) != 0) error = errno;
  if (error != 0) ::unlink(temporary.c_str());
  if (error == 0 && sync == Sync::kYes) {
    error = sync_folder(path);
  }
  if (error != 0) throw_io_error("cannot write", path, error);
}

// An open regular file, or why it is none.
struct OpenedFile {
  FileHandle file;
  std::uint64_t size_bytes = 0;
  std::string cause;
};

OpenedFile open_regular_file(const std::filesystem::path& path) {
  // Not blocking, so that a named pipe is refused below instead of waited for.
  OpenedFile opened = {FileHandle(::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK)), 0, ""};
  struct stat status {};
  if (!opened.file.is_open() || ::fstat(opened.file.descriptor(), &status) != 0) {
    opened.cause = text_of_errno(errno);
  } else if (!S_ISREG(status.st_mode)) {
    opened.cause = "it is no regular file";
  } else {
    opened.size_bytes = static_cast<std::uint64_t>(status.st_size);
  }
  return opened;
}

Error cannot_read(const std::filesystem::path& path, const std::string& cause) {
  return Error{fmt::format("cannot read {}: {}", path.string(), cause)};
}

// Reads until `bytes` is full; an empty string, or what went wrong.
std::string read_all(int descriptor, std::uint64_t offset, std::span<std::uint8_t> bytes) {
  std::size_t at = 0;
  while (at < bytes.size()) {
    const ssize_t got =
        ::pread(descriptor, bytes.data() + at, bytes.size() - at, static_cast<off_t>(offset + at));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return text_of_errno(errno);
    if (got == 0) {
      return fmt::format("it ends at byte {} of {}", offset + at, offset + bytes.size());
    }
    at += static_cast<std::size_t>(got);
  }
  return "";
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
    case ENAMETOOLONG:
      return "Choose a shorter name: most file systems hold 255 bytes in one, of which some are "
             "for "
             "the name while it is written.";
    case EMFILE:
    case ENFILE:
      return "Raise the limit on open files (ulimit -n).";
    case EIO:
      return "The disk reports a fault; check it, or choose another one.";
    default:
      return "";
  }
}

void throw_io_error(const std::string& what_failed, const std::filesystem::path& path,
                    int error_number) {
  throw IoError(what_failed, path.string(), text_of_errno(error_number),
                remedy_for_errno(error_number));
}

void write_file_atomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  write_and_rename(path, bytes, Sync::kNo);
}

void write_file_durably(const std::filesystem::path& path, std::span<const std::uint8_t> bytes) {
  write_and_rename(path, bytes, Sync::kYes);
}

void sync_folder_of(const std::filesystem::path& path) {
  const int error = sync_folder(path);
  if (error != 0) throw_io_error("cannot sync the folder of", path, error);
}

Result<std::vector<std::uint8_t>> read_file_bytes(const std::filesystem::path& path,
                                                  std::size_t limit_bytes) {
  const OpenedFile opened = open_regular_file(path);
  if (!opened.cause.empty()) return cannot_read(path, opened.cause);
  if (std::cmp_greater(opened.size_bytes, limit_bytes)) {
    return cannot_read(path, fmt::format("it has {} bytes, more than the {} allowed here",
                                         opened.size_bytes, limit_bytes));
  }
  std::vector<std::uint8_t> bytes(static_cast<std::size_t>(opened.size_bytes));
  const std::string cause = read_all(opened.file.descriptor(), 0, bytes);
  if (!cause.empty()) return cannot_read(path, cause);
  return bytes;
}

Result<std::vector<std::uint8_t>> read_file_range(const std::filesystem::path& path,
                                                  std::uint64_t offset, std::size_t bytes) {
  const OpenedFile opened = open_regular_file(path);
  if (!opened.cause.empty()) return cannot_read(path, opened.cause);
  // Before any memory is taken for it.
  if (offset > opened.size_bytes || bytes > opened.size_bytes - offset) {
    return cannot_read(path, fmt::format("it has {} bytes, too few for {} at byte {}",
                                         opened.size_bytes, bytes, offset));
  }
  std::vector<std::uint8_t> content(bytes);
  const std::string cause = read_all(opened.file.descriptor(), offset, content);
  if (!cause.empty()) return cannot_read(path, cause);
  return content;
}

}  // namespace qmpipe
