// A whole MBTiles file, in memory on disk: whatever it says, it is listed and read to its end, or
// refused, without a crash and within the work that its size explains.

#include <cstdint>
#include <cstdlib>
#include <iterator>

#include "formats/bytes/errors.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/tile/tile_set.h"
#include "tests/fuzz/file_in_memory.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  static const qmpipe::fuzz::FileInMemory file(".mbtiles");
  file.put({data, size});
  try {
    const auto set = qmpipe::open_mbtiles_set(file.path());
    static_cast<void>(set->layer_text());
    std::size_t read = 0;
    for (const qmpipe::TileKey& key : set->keys()) {
      if (++read > 20) break;
      const auto bytes = set->read(key);
      const auto stored_bytes = set->stored_bytes(key);
      if (bytes && stored_bytes && std::ssize(*bytes) != *stored_bytes) std::abort();
    }
  } catch (const qmpipe::IoError&) {
    // What a reader is told.
  }
  return 0;
}
