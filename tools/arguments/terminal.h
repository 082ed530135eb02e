// Whether somebody watches a command, and so how it shows its progress.
#pragma once

#include "pipeline/run/progress.h"

namespace qmpipe {

bool stderr_is_terminal();

// JSON lines where these were asked for, one line on a terminal, else nothing.
ProgressStyle progress_style(bool wants_json_lines);

}  // namespace qmpipe
