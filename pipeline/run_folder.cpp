#include "pipeline/run_folder.h"

#include <unistd.h>

#include <string>
#include <system_error>

#include "formats/errors.h"
#include "formats/file_bytes.h"

namespace qmpipe {

namespace fs = std::filesystem;

RunFolder::RunFolder(const fs::path& output) {
  if (output.empty()) {
    path_ = fs::temp_directory_path() / ("qmpipe-run-" + std::to_string(getpid()));
  } else {
    // "tiles/" and "tiles" are one folder.
    const fs::path plain = output.has_filename() ? output : output.parent_path();
    path_ = plain.string() + ".qmpipe-run";
  }
  std::error_code problem;
  fs::remove_all(path_, problem);
  if (!problem) fs::create_directories(path_, problem);
  if (problem) {
    throw IoError("cannot make the run's folder", path_.string(), problem.message(),
                  remedy_for_errno(problem.value()));
  }
}

RunFolder::~RunFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace qmpipe
