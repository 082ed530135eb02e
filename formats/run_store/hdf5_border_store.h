// A border store on disk: compressed borders in HDF5 segment files in a folder.
//
// Guarantees:
//   - A segment `borders-NNNNNN.h5` (formats/run_store/border_segment.h) has its name only when it is whole
//     and on the disk. What seal() returned from outlives a crash, taken or not; what was published
//     since is lost. A seal() writes one segment, or none when there is nothing new.
//   - The same borders between two seals make the same bytes, in whatever order they came.
//   - What is taken is what was published, or an IoError names the segment: chunks carry hashes,
//     and the rest of a segment a seal. After an IoError of seal() nothing is lost; seal() again.
//   - Memory: what was published since the last seal, the cache, and some 100 bytes for each 512
//     borders on disk; while a segment is written, what it holds twice more.
// What was published since the last seal is taken without touching the disk; the rest is read
// without a lock of HDF5 and with no file kept open. Whether a border that is on disk is published
// or taken twice goes unnoticed. The folder may be that of a lattice store; one border store at a
// time may use it.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>

#include "formats/bytes/result.h"
#include "formats/run_store/border_store.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

struct Hdf5BorderOptions {
  // Deepest zoom that the store has. REQUIRES: 0 .. kMaxZoom.
  std::int32_t max_zoom = 0;
  // Borders read from disk and kept for the next take, in bytes; 28 KiB are 512 borders. DEFAULT: 4
  // MiB.
  std::int64_t cache_bytes = std::int64_t{4} << 20U;
  // zstd's. DEFAULT: 3.
  int compression_level = 3;
};

// Opens the store in `folder`, which is made when it is absent; segments that are there already are
// read, rests of interrupted writes removed. Refuses a damaged, cut off, foreign or missing
// segment, naming it. Throws IoError when the folder cannot be used.
Result<std::unique_ptr<BorderStore>> open_hdf5_border_store(const std::filesystem::path& folder,
                                                            const TilingScheme& scheme,
                                                            const Hdf5BorderOptions& options);

// How many segments `folder` holds: for a journal, so that a resumed run notices when the last ones
// are gone, which the store itself cannot. Throws IoError when the folder cannot be listed.
std::int32_t count_border_segments(const std::filesystem::path& folder);

}  // namespace qmpipe
