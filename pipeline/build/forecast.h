// How long the phases of a run may take, before anything of it was measured: for the time left that
// progress shows, and for nothing else.
#pragma once

#include <cstdint>
#include <vector>

#include "pipeline/build/estimate.h"
#include "pipeline/recipe/build_options.h"
#include "pipeline/run/time_left.h"
#include "pipeline/survey/survey.h"

namespace qmpipe {

// How many tiles a build makes, about.
std::int64_t expected_tiles(const BuildOptions& options, const SurveyChoice& survey,
                            const std::vector<RasterInfo>& sources);

// Those of a build: the survey, of which nothing is known until it works, and meshing by what tiles
// usually take.
std::vector<ExpectedPhase> phases_of_build(const BuildOptions& options, const SurveyChoice& survey,
                                           const std::vector<RasterInfo>& sources);

// Meshing, as the estimate found it: zooms differ in what their tiles take.
ExpectedPhase mesh_phase(const Estimate& estimate);

// Those of a verification of so many tiles.
enum class AgainstSource { kYes, kNo };
std::vector<ExpectedPhase> phases_of_verify(std::int64_t tiles, AgainstSource against,
                                            std::int32_t threads);

}  // namespace qmpipe
