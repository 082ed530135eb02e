// Whole files in and out, with errors that say why.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "formats/bytes/result.h"

namespace qmpipe {

// What the name of a file under way ends with; such a file is the rest of an interrupted write.
inline constexpr const char* kTemporarySuffix = ".qmpipe-tmp";

// Writes a whole file under a temporary name in the same folder, then renames it: the file has its
// name only when it is whole, and an older file of that name stays until then. Not synced to disk.
// REQUIRES: no other thread writes the same path. Throws IoError with the system's reason and a
// remedy; then nothing is left behind.
void write_file_atomically(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);

// The same, and on return the file and its name are on the disk: it outlives a power cut.
void write_file_durably(const std::filesystem::path& path, std::span<const std::uint8_t> bytes);

// The names of what was made in the path's folder are on the disk after it. Throws IoError.
void sync_folder_of(const std::filesystem::path& path);

// Refuses what is no regular file, cannot be read or is larger than limit_bytes.
Result<std::vector<std::uint8_t>> read_file_bytes(const std::filesystem::path& path,
                                                  std::size_t limit_bytes);

// Refuses as read_file_bytes() does, and when the file ends before offset + bytes.
Result<std::vector<std::uint8_t>> read_file_range(const std::filesystem::path& path,
                                                  std::uint64_t offset, std::size_t bytes);

// "free some space or choose another disk" and the like, for an errno value; empty for reasons that
// explain themselves.
std::string remedy_for_errno(int error_number);

// An IoError with the system's reason and that remedy.
[[noreturn]] void throw_io_error(const std::string& what_failed, const std::filesystem::path& path,
                                 int error_number);

}  // namespace qmpipe
