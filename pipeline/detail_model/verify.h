// `qmpipe detail verify`: is a detail-increment model what it says?
//
// Walks every block through all of its levels, up and down again, and looks at the whole at its coarsest
// and finest levels, seams among it.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "formats/detail_model/data.h"
#include "pipeline/run/progress.h"

namespace qmpipe {

struct DetailVerifyReport {
  std::int64_t levels_walked = 0;
  std::int64_t triangles_checked = 0;
  // In sentences without full stops, by block; empty: all is well.
  std::vector<std::string> faults;
};

// Checks that: every split can be done; every triangle of every level is counter-clockwise; the way down
// leads to the same mesh at every level as the way up; a block's rim is the same
// on all levels; thresholds are finite and never rise towards finer levels; no edge of the whole, at the
// coarsest and the finest level, belongs to three triangles or to two on one side; no two triangles
// overlap there, as far as some thousand random places show. Of each block the first fault is told.
DetailVerifyReport verify_detail(const DetailModel& model, std::int32_t threads,
                                 Progress& progress);

}  // namespace qmpipe
