// What the writer and the reader of formats/detail_model/file.h must agree on.
#pragma once

#include <algorithm>
#include <cstdint>

#include "formats/detail_model/file.h"
#include "formats/hdf5/segment.h"
#include "formats/hdf5/word_chunk.h"

namespace qmpipe {

inline constexpr const char* kDetailCrs = "crs_wkt";
inline constexpr const char* kDetailFrame = "frame";
inline constexpr const char* kDetailInterval = "interval";
inline constexpr const char* kDetailSeams = "seams";
inline constexpr const char* kDetailBlocks = "blocks";
inline constexpr std::size_t kDetailBlockColumns = 3;

inline SegmentIdentity detail_identity() {
  return {.format_version = kDetailFormatVersion,
          .attribute = "format",
          .value = "qmpipe detail-increment model",
          .called = "format",
          .wanted_by = "the one this program reads",
          .remedy = "build the model again, or take a copy that is whole"};
}

// Zstd makes megabytes of a few bytes, so a small file could fill any memory. No file's arrays are
// larger than this; the writer lengthens one whose arrays are almost nothing but zeros.
constexpr std::uint64_t most_array_bytes(std::uint64_t file_bytes) {
  constexpr std::uint64_t kAlways = std::uint64_t{64} << 20U;
  constexpr std::uint64_t kTimes = 512;
  constexpr std::uint64_t kLargestFile = std::uint64_t{1} << 52U;
  return kAlways + kTimes * std::min(file_bytes, kLargestFile);
}
constexpr std::uint64_t least_file_bytes(std::uint64_t array_bytes) {
  return (array_bytes - std::min(array_bytes, most_array_bytes(0)) + 511) / 512;
}

// REQUIRES: words > 0.
constexpr std::uint64_t chunk_words_of(std::uint64_t words) {
  return std::min<std::uint64_t>(words, kMaxChunkWords);
}

}  // namespace qmpipe
