// A lattice store on disk: compressed blocks in HDF5 segment files in a folder.
//
// Guarantees:
//   - A segment `lattice-NNNNNN.h5` (formats/run_store/lattice_segment.h) has its name only when it is whole
//     and on the disk. What seal() returned from outlives a crash; what was put since may be lost.
//   - A later put of a block wins, across segments too; an all-void block hides an older one.
//   - What is read is what was put, or an IoError names the segment and the block: chunks carry
//     hashes, and the rest of a segment a seal.
//   - Memory: about segment_bytes of pending chunks, up to three times that while a segment is
//     written, the cache, and some 100 bytes for each block.
// Reads take no lock of HDF5 and keep no file open. One store at a time may use a folder.
// put_block(), read(), has_block() and seal() are safe from several threads, as long as no block is
// read while it is written. A put that fills a segment writes it; puts that fill the next one
// meanwhile wait for it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "formats/bytes/result.h"
#include "formats/run_store/lattice_store.h"

namespace qmpipe {

struct Hdf5LatticeOptions {
  // Deepest zoom that the store has. REQUIRES: 0 .. kMaxZoom.
  std::int32_t max_zoom = 0;
  // Compressed blocks that wait for a segment, in bytes. DEFAULT: 16 MiB.
  std::int64_t segment_bytes = std::int64_t{16} << 20U;
  // Decompressed blocks kept for the next read, in bytes. DEFAULT: 16 MiB.
  std::int64_t cache_bytes = std::int64_t{16} << 20U;
  // zstd's. DEFAULT: 1 (terrain gets about 1 % smaller at 3, for 1.4 to 2.5 times the work).
  int compression_level = 1;
};

// Opens the store in `folder`, which is made when it is absent; segments that are there already are
// read, rests of interrupted writes removed. Refuses a damaged, cut off, foreign or missing
// segment, naming it. Throws IoError when the folder cannot be used.
Result<std::unique_ptr<LatticeStore>> open_hdf5_lattice_store(const std::filesystem::path& folder,
                                                              const TilingScheme& scheme,
                                                              const Hdf5LatticeOptions& options);

// What a store of so many blocks takes in memory at most.
std::int64_t lattice_store_memory_bytes(const Hdf5LatticeOptions& options, std::int64_t blocks);

// How many segments `folder` holds: for a journal, so that a resumed run notices when the last ones
// are gone, which the store itself cannot. Throws IoError when the folder cannot be listed.
std::int32_t count_lattice_segments(const std::filesystem::path& folder);

}  // namespace qmpipe
