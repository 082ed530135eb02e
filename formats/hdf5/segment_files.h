// The segments of the stores on disk, which share a run's folder: their names, and whether all are
// there.
//
// All throw IoError when the folder cannot be used.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// lattice-NNNNNN.h5, borders-NNNNNN.h5
enum class SegmentKind { kLattice, kBorders };

// What to do about a segment that cannot be used, for the end of a message.
inline constexpr const char* kStartOver =
    "remove the run folder, or build with --overwrite, to start over";
// The same, when it was whole as the store was opened.
inline constexpr const char* kSegmentChanged =
    "The file was changed, moved or damaged since it was written; check the disk, then build with "
    "--overwrite to start over.";

std::filesystem::path segment_path(const std::filesystem::path& folder, SegmentKind kind,
                                   std::int32_t number);

// Of the segments that are there, in ascending order; other files are passed over.
std::vector<std::int32_t> segment_numbers(const std::filesystem::path& folder, SegmentKind kind);

// How many segments there are. Refuses a gap in their numbers, naming the file that is missing.
Result<std::int32_t> count_without_gaps(const std::filesystem::path& folder, SegmentKind kind);

// Makes the folder when it is absent, and removes what interrupted writes of such segments left.
void prepare_segment_folder(const std::filesystem::path& folder, SegmentKind kind);

// And what interrupted writes of such segments left; other files stay.
void remove_segments(const std::filesystem::path& folder, SegmentKind kind);

}  // namespace qmpipe
