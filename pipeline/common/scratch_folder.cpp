#include "pipeline/common/scratch_folder.h"

#include <fmt/format.h>
#include <unistd.h>

#include <system_error>

#include "formats/bytes/folders.h"

namespace qmpipe {

namespace fs = std::filesystem;

ScratchFolder::ScratchFolder(const fs::path& base) {
  const fs::path named = base.empty() ? fs::temp_directory_path() / "qmpipe-run" : base;
  path_ = fmt::format("{}-{}", named.string(), getpid());
  make_folders(path_);
}

ScratchFolder::~ScratchFolder() {
  std::error_code ignored;
  fs::remove_all(path_, ignored);
}

}  // namespace qmpipe
