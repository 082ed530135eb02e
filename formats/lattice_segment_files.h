// The names of a lattice store's segments in its folder.
//
// All throw IoError when the folder cannot be used.
#pragma once

#include <cstdint>
#include <filesystem>
#include <vector>

namespace qmpipe {

// lattice-NNNNNN.h5
std::filesystem::path segment_path(const std::filesystem::path& folder, std::int32_t number);

// Of the segments that are there, in ascending order; other files are passed over.
std::vector<std::int32_t> segment_numbers(const std::filesystem::path& folder);

// Makes the folder when it is absent, and removes what interrupted writes of segments left in it.
void prepare_segment_folder(const std::filesystem::path& folder);

}  // namespace qmpipe
