// What the writer and the reader of detail_file.h must agree on.
#pragma once

#include <algorithm>
#include <cstdint>

#include "formats/detail_file.h"
#include "formats/hdf5_segment.h"
#include "formats/word_chunk.h"

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

// REQUIRES: words > 0.
constexpr std::uint64_t chunk_words_of(std::uint64_t words) {
  return std::min<std::uint64_t>(words, kMaxChunkWords);
}

}  // namespace qmpipe
