// One file of the lattice store: a batch of compressed blocks in HDF5.
//
// Layout: dataset `blocks` (n, 256, 256) float32 little-endian, rows from the south, metres, voids
// NaN, chunks of one block through HDF5's shuffle and zstd (registered filter 32015); `keys` (n, 3)
// int32: zoom, x, y (south to north); `is_void` (n) uint8: 1 where the block was made all void, and
// has no chunk; `content_hash` (n) uint64: hash64() of the chunk's bytes, seeded with the packed
// key. Root attributes `format_version` (int32, 1) and `scheme` ("geodetic" or "mercator"). The
// file ends with a seal (formats/bytes/seal.h), which HDF5 ignores.
// h5py with hdf5plugin, and h5dump with the plugin, read it.
// These functions may run on several threads at once where HDF5 was built thread-safe.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <span>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/bytes/seal.h"
#include "scheduler/block_key.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

inline constexpr std::int32_t kSegmentFormatVersion = 1;
// No segment holds more.
inline constexpr std::size_t kMaxSegmentBlocks = 1U << 16U;

struct PackedBlock {
  BlockKey key;
  std::vector<std::uint8_t> chunk;  // empty: all void
  std::uint64_t content_hash = 0;
};

struct SegmentEntry {
  BlockKey key;
  ByteRange chunk;  // no bytes: all void
  std::uint64_t content_hash = 0;
};

struct EncodedSegment {
  std::vector<std::uint8_t> bytes;  // the whole file
  std::vector<SegmentEntry> entries;
};

std::uint64_t content_hash(const BlockKey& key, std::span<const std::uint8_t> chunk);

// Builds the file in memory, so that only our own code meets a full disk. `path` appears in
// messages, and no other thread may encode under the same one.
// REQUIRES: 1 .. kMaxSegmentBlocks blocks.
EncodedSegment encode_lattice_segment(
    const std::filesystem::path& path, const TilingScheme& scheme,
    const std::vector<std::shared_ptr<const PackedBlock>>& blocks);

// Refuses a file that is not exactly what was written (chunks excepted: their hashes are checked
// when they are read), is of another version or scheme, or has blocks outside the scheme or deeper
// than max_zoom. The message names the file.
Result<std::vector<SegmentEntry>> read_lattice_segment(const std::filesystem::path& path,
                                                       const TilingScheme& scheme,
                                                       std::int32_t max_zoom);

}  // namespace qmpipe
