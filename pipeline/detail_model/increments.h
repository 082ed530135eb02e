// How much merging increments over an interval saves (Ai et al. 2019, section 2.2.2), reckoned on a
// model's own increments.
#pragma once

#include <cstdint>

#include "formats/bytes/result.h"
#include "formats/detail_model/data.h"

namespace qmpipe {

struct IncrementSums {
  std::int64_t levels = 0;
  std::int64_t increments = 0;  // over the model's interval
  // Triangles in increments of one level each, and of an interval each.
  std::int64_t changed_singly = 0;
  std::int64_t changed_merged = 0;
  // What the arrays of Table 1 take for them, with numbers of 4 bytes.
  std::int64_t raw_bytes_singly = 0;
  std::int64_t raw_bytes_merged = 0;
};

// An error names the block whose splits are damaged.
Result<IncrementSums> sum_increments(const DetailModel& model);

}  // namespace qmpipe
