// The second pass: meshes every tile of the plan into the sink, with checkpoints where a record is
// kept, from where an earlier run has stopped.
#pragma once

#include "formats/tile_sink.h"
#include "pipeline/build_options.h"
#include "pipeline/build_plan.h"
#include "pipeline/progress.h"
#include "pipeline/report.h"
#include "pipeline/run_record.h"
#include "scheduler/memory_budget.h"
#include "stages/heightfield.h"

namespace qmpipe {

// On return the sink has every tile. `record` may be null: then nothing is written down, and an
// interrupted run starts again. Tiles that the record counts but the sink does not have make the
// pass start at the first tile again.
// Throws Interrupted (after a checkpoint), IoError; also when the sink has lost tiles meanwhile.
BuildReport run_mesh_pass(const BuildOptions& options, const BuildPlan& plan,
                          const Heightfield& heightfield, const MemoryPlan& memory, TileSink& sink,
                          RunRecord* record, Progress& progress);

}  // namespace qmpipe
