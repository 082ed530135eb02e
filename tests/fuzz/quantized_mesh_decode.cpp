// Any bytes: decode() neither throws nor over-reads. Bytes that it accepts: what encode() makes of
// the tile is accepted too, and comes back as the same bytes.
#include <cstdint>
#include <cstdlib>
#include <span>
#include <vector>

#include "formats/tile/quantized_mesh.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const auto tile = qmpipe::decode(std::span(data, size));
  if (!tile.ok()) return 0;
  const std::vector<std::uint8_t> bytes = qmpipe::encode(*tile);
  const auto again = qmpipe::decode(bytes);
  if (!again.ok() || qmpipe::encode(*again) != bytes) std::abort();
  return 0;
}
