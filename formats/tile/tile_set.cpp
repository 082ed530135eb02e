#include "formats/tile/tile_set.h"

#include <fmt/format.h>

#include "formats/bytes/gzip.h"
#include "formats/tile/quantized_mesh.h"

namespace qmpipe {

Result<std::vector<std::uint8_t>> plain_tile_bytes(std::vector<std::uint8_t> stored) {
  if (is_gzip(stored)) {
    auto plain = gzip_decompress(stored, kLargestTileBytes);
    // A tile begins with a coordinate, whose bytes may look like gzip's.
    if (plain || !decode(stored)) return plain;
  }
  if (stored.size() > kLargestTileBytes) {
    return Error{fmt::format("the tile has {} bytes, more than the {} allowed", stored.size(),
                             kLargestTileBytes)};
  }
  return stored;
}

}  // namespace qmpipe
