// A file of lines that outlives a crash: what a run has finished, in the order it did.
//
// A line is 16 hexadecimal digits, a space, the text, a newline; the digits are the hash64() of the
// text, seeded with the line before it. So a line that was cut off, changed, or torn out of its
// place is known for what it is.
// Guarantees: what append() returned from is on the disk. What a crash tore from the end when it was
// opened is dropped; damage before a sound line is refused. One process at a time has it open.
// Used by one thread at a time.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/file_lock.h"
#include "formats/bytes/result.h"

namespace qmpipe {

struct JournalContent {
  std::vector<std::string> lines;
  // Of the lines that are whole; what follows them is the rest of an interrupted append.
  std::size_t sound_bytes = 0;
  std::uint64_t last_hash = 0;
};

// Refuses bytes in which a damaged line is followed by a sound one.
Result<JournalContent> parse_journal(std::span<const std::uint8_t> bytes);

class Journal {
 public:
  // Makes the file when it is absent. Refuses a damaged one, naming it. Throws IoError when it
  // cannot be used, or when another process has it open.
  static Result<std::unique_ptr<Journal>> open(const std::filesystem::path& path);
  ~Journal();
  Journal(const Journal&) = delete;
  Journal& operator=(const Journal&) = delete;

  // Those that were there when it was opened.
  const std::vector<std::string>& lines() const { return content_.lines; }
  // REQUIRES: no newline in `text`. Throws IoError; then the file holds what it held before.
  void append(const std::string& text);
  // Begins anew, as if it had just been made. Throws IoError.
  void clear();

 private:
  Journal(std::filesystem::path path, int descriptor);

  const std::filesystem::path path_;
  const int descriptor_;
  std::unique_ptr<LockFile> lock_file_;  // where there are no better locks
  JournalContent content_;
};

}  // namespace qmpipe
