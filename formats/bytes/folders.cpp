#include "formats/bytes/folders.h"

#include <system_error>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"

namespace qmpipe {

namespace fs = std::filesystem;

void make_folders(const fs::path& folder) {
  std::error_code code;
  fs::create_directories(folder, code);
  if (code) throw_io_error("cannot create the folder", folder, code.value());
}

void require_folder_of(const std::filesystem::path& file, const std::string& what_failed) {
  const std::filesystem::path folder = std::filesystem::absolute(file).parent_path();
  std::error_code code;
  if (std::filesystem::is_directory(folder, code)) return;
  throw IoError(what_failed, file.string(), "there is no folder " + folder.string(),
                "make it, or choose another name");
}

std::vector<fs::directory_entry> entries_of(const fs::path& folder) {
  std::error_code code;
  std::vector<fs::directory_entry> entries;
  for (fs::directory_iterator it(folder, code), end; !code && it != end; it.increment(code)) {
    entries.push_back(*it);
  }
  if (code) throw_io_error("cannot list the folder", folder, code.value());
  return entries;
}

void remove_file(const fs::path& path) {
  std::error_code code;
  fs::remove(path, code);
  if (code) throw_io_error("cannot remove", path, code.value());
}

void remove_folder_if_empty(const fs::path& folder) {
  std::error_code code;
  fs::remove(folder, code);
  if (code && code != std::errc::directory_not_empty) {
    throw_io_error("cannot remove the folder", folder, code.value());
  }
}

}  // namespace qmpipe
