// Whether an output already is what a build is asked for: jobs that are queued again should end well.
//
// report.json remembers what a set was built from (pipeline/recipe/fingerprint.h) and which layer.json it belongs
// to. It is no part of the tile set: without it nothing is known, and the output is treated as anybody's.
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "pipeline/recipe/build_options.h"

namespace qmpipe {

struct FinishedSet {
  std::string report_json;
  std::int64_t tiles = 0;
  // What was other when it was built, or is missing now, each a sentence without a full stop; empty
  // when the output is what the options ask for.
  std::vector<std::string> differences;
};

// None when the output holds no finished set of this program, or one without its report. Throws IoError
// when an input cannot be opened.
std::optional<FinishedSet> finished_set(const BuildOptions& options);

}  // namespace qmpipe
