// Any bytes: gzip_decompress() neither throws nor over-reads, and keeps its limit. What it accepts
// comes back the same after another round.
#include "formats/bytes/gzip.h"

#include <cstdint>
#include <cstdlib>
#include <span>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kLimitBytes = 100000;
  const auto plain = qmpipe::gzip_decompress(std::span(data, size), kLimitBytes);
  if (!plain.ok()) return 0;
  if (plain->size() > kLimitBytes) std::abort();
  const auto again = qmpipe::gzip_decompress(qmpipe::gzip_compress(*plain, 1), kLimitBytes);
  if (!again.ok() || *again != *plain) std::abort();
  return 0;
}
