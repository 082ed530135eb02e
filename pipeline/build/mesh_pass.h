// The second pass: meshes every tile of the plan into the sink, with checkpoints where a record is
// kept, from where an earlier run has stopped.
#pragma once

#include "formats/tile/tile_sink.h"
#include "pipeline/build/build_plan.h"
#include "pipeline/build/report.h"
#include "pipeline/recipe/build_options.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/run_record.h"
#include "scheduler/memory_budget.h"
#include "stages/posts/heightfield.h"

namespace qmpipe {

// On return the sink has every tile. `record` may be null: then nothing is written down, and an
// interrupted run starts again. Tiles that the record counts but the sink does not have make the
// pass start at the first tile again.
// Throws Interrupted (after a checkpoint), IoError; also when the sink has lost tiles meanwhile.
BuildReport run_mesh_pass(const BuildOptions& options, const BuildPlan& plan,
                          const Heightfield& heightfield, const MemoryPlan& memory, TileSink& sink,
                          RunRecord* record, Progress& progress);

}  // namespace qmpipe
