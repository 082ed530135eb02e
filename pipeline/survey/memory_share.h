// Which zooms' lattices stay in memory, and how the rest of the budget is shared out.
#pragma once

#include <cstdint>
#include <vector>

#include "formats/tile_sets/tile_output.h"
#include "pipeline/survey/choice.h"
#include "scheduler/memory_budget.h"
#include "scheduler/tile_key.h"

namespace qmpipe {

struct MemoryShare {
  MemoryPlan plan;
  // Deeper zooms are kept on disk, compressed; -1: all are. DEFAULT: none.
  std::int32_t last_memory_zoom = kMaxZoom;
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
  TileForm output = TileForm::kFolder;
};

// The ways to divide the budget between a lattice in memory and the work.
class MemoryDivisions {
 public:
  // Throws UsageError with the least limit that would do, where no way leaves enough for the work.
  MemoryDivisions(const MemoryRequest& request, const SurveyChoice& choice,
                  const std::vector<RasterInfo>& sources);

  // As many zooms as fit half the limit and leave the source its cache stay in memory, coarse ones first; those deeper
  // than this go to disk even when they would fit. Throws as the constructor does, where too few are left.
  MemoryShare best(std::int32_t deepest_memory_zoom = kMaxZoom) const;

 private:
  struct Division {
    MemoryShare share;
    std::int64_t lattice_bytes = 0;
  };

  const Division& chosen(std::int32_t deepest_memory_zoom) const;
  [[noreturn]] void refuse() const;

  std::int64_t limit_bytes_ = 0;
  bool is_limit_given_ = false;
  std::int32_t sampling_zoom_ = 0;
  std::int64_t least_limit_bytes_ = 0;  // that works for one of them
  std::int64_t front_bytes_ = 0;
  std::int64_t rows_of_blocks_bytes_ = 0;
  std::vector<Division> divisions_;  // those that work, most of the lattice in memory first
};

}  // namespace qmpipe
