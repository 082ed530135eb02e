// Which zooms' lattices stay in memory, and how the rest of the budget is shared out.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/tile_sets/tile_output.h"
#include "pipeline/survey/survey.h"
#include "scheduler/memory_budget.h"

namespace qmpipe {

struct MemoryShare {
  MemoryPlan plan;
  // Deeper zooms are kept on disk.
  std::int32_t last_memory_zoom = 0;
  // What they take there at most (uncompressed; terrain packs to about half).
  std::int64_t store_bytes = 0;
  // For blocks that are read back from there; a part of the plan's peak.
  std::int64_t block_cache_bytes = 0;
};

struct MemoryRequest {
  // 0: nine tenths of the machine's memory.
  std::int64_t limit_bytes = 0;
  // What a thread holds while it simplifies a tile (simplify_bytes() of the method).
  std::int64_t simplify_bytes = 0;
  // Deeper zooms go to disk even when they would fit.
  std::int32_t deepest_memory_zoom = kMaxZoom;
  TileForm output = TileForm::kFolder;
};

// As many zooms as fit half the limit and leave the source its cache stay in memory, coarse ones
// first; where no division leaves enough for the work, throws UsageError with the least limit that
// would do.
MemoryShare share_memory(const MemoryRequest& request, const SurveyOptions& survey,
                         const std::vector<RasterInfo>& sources);

}  // namespace qmpipe
