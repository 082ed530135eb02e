// What decides a run's bytes, as text: the first line of its journal. A run may continue what another
// one has left only when both have the same (docs/decisions/0004-checkpoints-count-a-prefix.md).
//
// Threads, memory and what layer.json says about the set (name, description, attribution) are not in
// it: no tile depends on them.
#pragma once

#include <string>
#include <vector>

#include "pipeline/recipe/build_options.h"

namespace qmpipe {

// JSON: program version, every input's files with size and time of change, every parameter under
// its name on the command line. Throws IoError when an input cannot be opened.
std::string fingerprint_of(const BuildOptions& options);

// What differs between an earlier run's fingerprint and this one's, each a sentence without a full
// stop that names the file or option; empty when they are equal.
std::vector<std::string> fingerprint_differences(const std::string& earlier,
                                                 const std::string& now);

// What decides a finished set's bytes, layer.json included, for its report: the same, but the inputs are a
// hash, since the report may be served with the tiles, and with the texts of layer.json.
std::string provenance_of(const BuildOptions& options);
std::vector<std::string> provenance_differences(const std::string& earlier, const std::string& now);

}  // namespace qmpipe
