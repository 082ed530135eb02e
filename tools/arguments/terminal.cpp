#include "tools/arguments/terminal.h"

#include <unistd.h>

namespace qmpipe {

bool stderr_is_terminal() { return ::isatty(STDERR_FILENO) != 0; }

ProgressStyle progress_style(bool wants_json_lines) {
  if (wants_json_lines) return ProgressStyle::kJsonLines;
  return stderr_is_terminal() ? ProgressStyle::kTerminal : ProgressStyle::kSilent;
}

}  // namespace qmpipe
