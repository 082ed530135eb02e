// The statistics of the tiles done so far, as a checkpoint keeps them: a resumed run adds to them,
// and ends with the sums of an uninterrupted one, bit for bit.
#pragma once

#include <string>

#include "formats/bytes/result.h"
#include "pipeline/build/report.h"

namespace qmpipe {

// JSON, one line.
std::string write_report_state(const BuildReport& report);

// `into` with the sums of `text`. Refuses text that lacks a value or does not have `into`'s zooms.
Result<BuildReport> with_report_state(BuildReport into, const std::string& text);

}  // namespace qmpipe
