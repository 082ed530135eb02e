// One file of the border store: a batch of borders in HDF5.
//
// Layout: dataset `borders` (n) of records {zoom, x, y: int32, side: uint8, mask: uint8[33]}
// (formats/run_store/border_chunk.h has their bytes), in ascending order of zoom, y, x, side, so row by row
// of tiles; chunks of min(n, 512) records through HDF5's shuffle and zstd (registered filter
// 32015). For each chunk `chunk_first` and `chunk_last` (m, 4) int32: zoom, x, y, side of its first
// and last border, and `content_hash` (m) uint64: hash64() of its bytes, seeded with its first
// border's name. The rest, attributes and seal, is as in formats/hdf5/segment.h; format_version is
// 1. Chunks of a fixed size and not one for each row, because a row has from one tile to millions.
// h5py with hdf5plugin, and h5dump with the plugin, read it: numpy.unpackbits(mask, axis=-1,
// count=257, bitorder="little") gives the posts of a side.
// These functions may run on several threads at once where HDF5 was built thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/bytes/seal.h"
#include "formats/run_store/border_chunk.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

inline constexpr std::int32_t kBorderSegmentVersion = 1;
// No segment holds more.
inline constexpr std::size_t kMaxSegmentBorders = std::size_t{1} << 24U;

// Where some borders are, neighbours in the file's order.
struct BorderChunk {
  BorderKey first;
  BorderKey last;
  ByteRange range;
  std::uint64_t content_hash = 0;
  std::uint32_t count = 0;
  std::uint32_t records = 0;
};

struct EncodedBorderSegment {
  std::vector<std::uint8_t> bytes;  // the whole file
  std::vector<BorderChunk> chunks;
};

// Builds the file in memory. `path` appears in messages, and no other thread may encode under the
// same one. REQUIRES: 1 .. kMaxSegmentBorders borders in ascending order of their keys.
EncodedBorderSegment encode_border_segment(const std::filesystem::path& path,
                                           const TilingScheme& scheme,
                                           const std::vector<Border>& borders, int level);

// Refuses a file that is not exactly what was written (chunks excepted: their hashes are checked
// when they are read), is of another version or scheme, or has chunks that start or end outside
// the scheme or deeper than max_zoom. The message names the file.
Result<std::vector<BorderChunk>> read_border_segment(const std::filesystem::path& path,
                                                     const TilingScheme& scheme,
                                                     std::int32_t max_zoom);

// Refuses any bytes but those that were written; the message says why.
Result<std::vector<Border>> read_border_chunk(const std::filesystem::path& path,
                                              const BorderChunk& chunk);

}  // namespace qmpipe
