// Folders, with errors that say why.
#pragma once

#include <filesystem>
#include <string>
#include <vector>

namespace qmpipe {

// The folders above it too; nothing when it is there. Throws IoError.
void make_folders(const std::filesystem::path& folder);

// For a file that is to be written after hours of work: throws the IoError that says so, beginning with
// `what_failed`, when there is no folder for it.
void require_folder_of(const std::filesystem::path& file, const std::string& what_failed);

// What stands in a folder, in no order. Throws IoError.
std::vector<std::filesystem::directory_entry> entries_of(const std::filesystem::path& folder);

// Nothing when there is none. Throws IoError.
void remove_file(const std::filesystem::path& path);

// Leaves a folder that holds anything. Throws IoError.
void remove_folder_if_empty(const std::filesystem::path& folder);

}  // namespace qmpipe
