// Any bytes: parse_journal() neither throws nor over-reads. What it accepts is the same when the part
// that it calls sound is read alone.
#include "formats/bytes/journal.h"

#include <cstdint>
#include <cstdlib>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto content = qmpipe::parse_journal(std::span(data, size));
  if (!content.ok()) return 0;
  if (content->sound_bytes > size) std::abort();
  const auto again = qmpipe::parse_journal(std::span(data, content->sound_bytes));
  if (!again.ok() || again->lines != content->lines || again->last_hash != content->last_hash) {
    std::abort();
  }
  return 0;
}
