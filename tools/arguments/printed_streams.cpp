#include "tools/arguments/printed_streams.h"

#include <unistd.h>

#include <cerrno>
#include <string>

#include "formats/bytes/errors.h"
#include "formats/bytes/printable.h"

namespace qmpipe {
namespace {

bool write_all(int descriptor, std::string_view text) {
  while (!text.empty()) {
    const ssize_t written = ::write(descriptor, text.data(), text.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) return false;
    text.remove_prefix(static_cast<std::size_t>(written));
  }
  return true;
}

}  // namespace

void require_printed() {
  if (std::fflush(stdout) == 0 && std::ferror(stdout) == 0) return;
  // Flushed again, it would only fail again.
  std::clearerr(stdout);
  throw IoError("cannot write to", "the standard output", "what was printed is not complete",
                "Free some space on its disk, or send it somewhere else.");
}

struct PrintedStreams::Stream {
  int descriptor;
  PrintableFilter filter = {};
  std::FILE* file = nullptr;

  explicit Stream(int descriptor_) : descriptor(descriptor_) {
    cookie_io_functions_t functions = {};
    functions.write = [](void* cookie, const char* text, std::size_t bytes) -> ssize_t {
      auto* const stream = static_cast<Stream*>(cookie);
      const bool is_written =
          write_all(stream->descriptor, stream->filter.pass(std::string_view(text, bytes)));
      return is_written ? static_cast<ssize_t>(bytes) : 0;
    };
    file = ::fopencookie(this, "w", functions);
    // As the streams behind them are: an error's message at once, results line by line where one looks on.
    if (file == nullptr) return;
    if (descriptor == STDERR_FILENO) {
      std::setvbuf(file, nullptr, _IONBF, 0);
    } else if (::isatty(descriptor) != 0) {
      std::setvbuf(file, nullptr, _IOLBF, BUFSIZ);
    }
  }
  ~Stream() {
    if (file == nullptr) return;
    std::fclose(file);
    static_cast<void>(write_all(descriptor, filter.finish()));
  }
  Stream(const Stream&) = delete;
  Stream& operator=(const Stream&) = delete;
};

PrintedStreams::PrintedStreams()
    : out_(std::make_unique<Stream>(STDOUT_FILENO)), err_(std::make_unique<Stream>(STDERR_FILENO)) {
  std::fflush(stdout);
  std::fflush(stderr);
  swap_streams();
}

PrintedStreams::~PrintedStreams() { swap_streams(); }

// One that could not be made leaves the system's in its place.
void PrintedStreams::swap_streams() {
  if (out_->file != nullptr) std::swap(stdout, out_->file);
  if (err_->file != nullptr) std::swap(stderr, err_->file);
}

}  // namespace qmpipe
