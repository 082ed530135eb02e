// Any bytes: unpack_borders() neither throws nor over-reads. What it accepts is in order, and comes
// back the same after another round. The first two bytes say how many borders and records there are.
#include <cstdint>
#include <cstdlib>
#include <span>

#include "formats/run_store/border_chunk.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  if (size < 2) return 0;
  const std::size_t records = 1 + data[0];
  const std::size_t count = 1 + data[1] % records;
  const auto borders = qmpipe::unpack_borders(std::span(data, size).subspan(2), count, records);
  if (!borders.ok()) return 0;
  if (borders->size() != count) std::abort();
  const auto again =
      qmpipe::unpack_borders(qmpipe::pack_borders(*borders, records, 1), count, records);
  if (!again.ok() || *again != *borders) std::abort();
  return 0;
}
