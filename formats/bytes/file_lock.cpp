#include "formats/bytes/file_lock.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/file.h>
#include <unistd.h>

#include <array>
#include <cerrno>
#include <charconv>
#include <csignal>
#include <system_error>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"

namespace qmpipe {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kMostLockBytes = 4096;
const char* const kAtWork = "another run is at work with it";

std::string own_host() {
  std::array<char, 256> name{};
  if (::gethostname(name.data(), name.size() - 1) != 0) return "?";
  return name.data();
}

// "HOST PID", of a file that may be half written or anybody's; empty when it cannot be read.
std::string holder_in(const fs::path& path) {
  const auto bytes = read_file_bytes(path, kMostLockBytes);
  if (!bytes) return "";
  std::string text;
  for (const std::uint8_t byte : *bytes) {
    if (byte > ' ' && byte < 127) text += static_cast<char>(byte);
    if (byte == ' ') text += ' ';
  }
  return text;
}

// What is known of whoever made the lock file.
std::string holder_text(const std::string& holder) {
  const auto space = holder.rfind(' ');
  pid_t process = 0;
  if (space == std::string::npos) return "a process that could not say which";
  const char* const end = holder.data() + holder.size();
  const auto parsed = std::from_chars(holder.data() + space + 1, end, process);
  if (parsed.ec != std::errc() || parsed.ptr != end || process <= 0) {
    return "a process that could not say which";
  }
  const std::string host = holder.substr(0, space);
  std::string text = fmt::format("process {} on {}", process, host);
  const bool is_gone = ::kill(process, 0) != 0 && errno == ESRCH;
  if (host == own_host() && is_gone) text += ", where no such process runs now,";
  return text;
}

[[noreturn]] void refuse(const fs::path& file, const fs::path& lock) {
  throw IoError(
      "cannot use", file.string(),
      fmt::format("{}, or was killed: {} made {}", kAtWork, holder_text(holder_in(lock)),
                  lock.string()),
      fmt::format("Wait for that run, or stop it. Its file system has no locks that end with a "
                  "process: when that process is gone, remove {} and run again.",
                  lock.string()));
}

}  // namespace

LockFile::LockFile(fs::path path, std::string holder)
    : path_(std::move(path)), holder_(std::move(holder)) {}

LockFile::~LockFile() {
  // Somebody may have removed it, wrongly, and another run have made its own.
  if (holder_in(path_) == holder_) ::unlink(path_.c_str());
}

std::unique_ptr<LockFile> LockFile::make(const fs::path& file) {
  const fs::path path = file.string() + ".lock";
  const int descriptor = ::open(path.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
  if (descriptor < 0 && errno == EEXIST) refuse(file, path);
  if (descriptor < 0) throw_io_error("cannot lock", file, errno);
  const std::string holder = fmt::format("{} {}", own_host(), ::getpid());
  const ssize_t written = ::write(descriptor, holder.data(), holder.size());
  int error = written < 0 ? errno : ENOSPC;
  if (written == static_cast<ssize_t>(holder.size())) error = 0;
  if (::close(descriptor) != 0 && error == 0) error = errno;
  if (error != 0) {
    ::unlink(path.c_str());
    throw_io_error("cannot write", path, error);
  }
  return std::unique_ptr<LockFile>(new LockFile(path, holder));
}

std::unique_ptr<LockFile> lock_open_file(int descriptor, const fs::path& file) {
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return nullptr;
  const int error = errno;
  if (means_no_locks(error)) return LockFile::make(file);
  if (error != EWOULDBLOCK) throw_io_error("cannot lock", file, error);
  throw IoError("cannot use", file.string(), kAtWork, "Wait for that run, or stop it.");
}

bool means_no_locks(int error_number) {
  return error_number == ENOSYS || error_number == EOPNOTSUPP || error_number == ENOLCK;
}

}  // namespace qmpipe
