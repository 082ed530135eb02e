// A whole build: survey, plan, estimate, mesh pass, layer.json, report.json.
//
// Guarantees: the tiles and layer.json depend on the inputs and the recipe alone, not on threads,
// memory or interruptions. layer.json is written last: a folder without it is no finished tile set.
// An output that is what the options ask for is left as it is, unless they say to overwrite it.
// A run that was stopped, killed or failed is gone on with by the next one with the same inputs and
// parameters (pipeline/run/run_record.h).
// Throws UsageError (options), IoError (files), Interrupted (asked to stop), InternalError (a bug).
#pragma once

#include "pipeline/build/estimate.h"
#include "pipeline/build/finished_set.h"
#include "pipeline/build/report.h"
#include "pipeline/recipe/build_options.h"
#include "pipeline/run/progress.h"
#include "pipeline/survey/survey.h"

namespace qmpipe {

struct BuildResult {
  Recipe recipe;
  Estimate estimate;
  // Empty after a dry run, and when the set was there already.
  BuildReport report;
  // The output was what the options ask for, and nothing was done.
  std::optional<FinishedSet> found;
};

// What its survey is asked for.
SurveyChoice survey_choice(const BuildOptions& options);

BuildResult build_pyramid(const BuildOptions& options, Progress& progress);

}  // namespace qmpipe
