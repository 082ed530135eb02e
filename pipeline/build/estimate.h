// What a build will cost, said before it starts: tiles are counted, bytes and time are measured on a
// sample of tiles, memory comes from the plan.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "pipeline/build/build_plan.h"
#include "pipeline/run/progress.h"
#include "pipeline/survey/survey.h"
#include "scheduler/memory_budget.h"
#include "stages/posts/heightfield.h"

namespace qmpipe {

struct ZoomEstimate {
  std::int32_t zoom = 0;
  std::int64_t tiles = 0;
  std::int64_t bytes = 0;
  double seconds = 0;  // of one core
};

struct Estimate {
  std::vector<ZoomEstimate> zooms;
  std::int64_t tiles = 0;
  std::int64_t bytes = 0;
  double seconds = 0;  // of wall time, on the given number of threads that have a core
  std::int64_t expected_peak_bytes = 0;
  std::int64_t store_bytes = 0;  // of disk at most, for the lattice while the run lasts
  std::int32_t sampling_zoom = 0;
};

// Meshes 16 to 64 tiles, or all where they are fewer, without their neighbours' borders, on the run's
// threads. Tiles are drawn in proportion to what their ranges and valid posts let expect of them, and
// count by what they turn out to be: bytes come out within a fifth for nine of ten real DEMs, whatever
// flat or empty tiles stand among the rugged ones.
// Throws Interrupted when asked to stop.
Estimate estimate_build(const BuildOptions& options, const Survey& survey, const BuildPlan& plan,
                        const Heightfield& heightfield, const MemoryPlan& memory,
                        Progress& progress);

// So many of that many tiles, or one of each zoom where that is more.
std::int64_t sampled_tiles(std::int64_t tiles);

std::string estimate_text(const Estimate& estimate);
std::string estimate_json(const Estimate& estimate);  // one line

// "1.2 MB", powers of ten, as disks are sold.
std::string bytes_text(std::int64_t bytes);

}  // namespace qmpipe
