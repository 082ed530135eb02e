#include "formats/bytes/random_access_file.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "scheduler/check.h"

namespace qmpipe {

RandomAccessFile::RandomAccessFile(std::filesystem::path path, int descriptor)
    : path_(std::move(path)), descriptor_(descriptor) {}

RandomAccessFile::RandomAccessFile(RandomAccessFile&& other) noexcept
    : path_(std::move(other.path_)),
      descriptor_(std::exchange(other.descriptor_, -1)),
      size_bytes_(other.size_bytes_) {}

RandomAccessFile::~RandomAccessFile() {
  if (descriptor_ >= 0) ::close(descriptor_);
}

RandomAccessFile RandomAccessFile::open_to_read(const std::filesystem::path& path) {
  // Not blocking, so that a named pipe is refused below instead of waited for.
  RandomAccessFile file(path, ::open(path.c_str(), O_RDONLY | O_CLOEXEC | O_NONBLOCK));
  struct stat status {};
  if (file.descriptor_ < 0 || ::fstat(file.descriptor_, &status) != 0) {
    throw_io_error("cannot open", path, errno);
  }
  if (!S_ISREG(status.st_mode)) {
    throw IoError("cannot open", path.string(), "it is no regular file", "Check the path.");
  }
  file.size_bytes_ = static_cast<std::uint64_t>(status.st_size);
  return file;
}

RandomAccessFile RandomAccessFile::create(const std::filesystem::path& path) {
  RandomAccessFile file(path, ::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0666));
  if (file.descriptor_ < 0) throw_io_error("cannot write", path, errno);
  return file;
}

Result<std::vector<std::uint8_t>> RandomAccessFile::read(std::uint64_t offset,
                                                         std::uint64_t bytes) const {
  const auto refused = [&](const std::string& cause) {
    return Error{fmt::format("cannot read {} bytes at byte {} of {}: {}", bytes, offset,
                             path_.string(), cause)};
  };
  if (offset > size_bytes_ || bytes > size_bytes_ - offset) {
    return refused(fmt::format("it has {} bytes", size_bytes_));
  }
  std::vector<std::uint8_t> content(static_cast<std::size_t>(bytes));
  std::size_t done = 0;
  while (done < content.size()) {
    const ssize_t got = ::pread(descriptor_, content.data() + done, content.size() - done,
                                static_cast<off_t>(offset + done));
    if (got < 0 && errno == EINTR) continue;
    if (got < 0) return refused(std::generic_category().message(errno));
    if (got == 0) return refused("it became shorter");
    done += static_cast<std::size_t>(got);
  }
  return content;
}

void RandomAccessFile::write(std::uint64_t offset, std::span<const std::uint8_t> bytes) {
  QMPIPE_CHECK(descriptor_ >= 0);
  size_bytes_ = std::max<std::uint64_t>(size_bytes_, offset + bytes.size());
  while (!bytes.empty()) {
    const ssize_t written =
        ::pwrite(descriptor_, bytes.data(), bytes.size(), static_cast<off_t>(offset));
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) throw_io_error("cannot write", path_, errno);
    bytes = bytes.subspan(static_cast<std::size_t>(written));
    offset += static_cast<std::uint64_t>(written);
  }
}

void RandomAccessFile::sync() const {
  if (::fsync(descriptor_) != 0) throw_io_error("cannot sync", path_, errno);
}

void RandomAccessFile::close() {
  if (::close(std::exchange(descriptor_, -1)) != 0) throw_io_error("cannot write", path_, errno);
}

}  // namespace qmpipe
