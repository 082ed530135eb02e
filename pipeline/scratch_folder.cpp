#include "pipeline/scratch_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>

#include "formats/errors.h"
#include "formats/file_bytes.h"

namespace qmpipe {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const fs::path& base) {
  const fs::path named = base.empty() ? fs::temp_directory_path() / "qmpipe-run" : base;
  path_ = fmt::format("{}-{}", named.string(), getpid());
  std::error_code problem;
  fs::create_directories(path_, problem);
  if (problem) {
    throw IoError("cannot make the run's folder", path_.string(), problem.message(),
                  remedy_for_errno(problem.value()));
  }
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace qmpipe
