// A survey that lives in memory, put on the disk because its run was asked to stop.
#pragma once

#include "pipeline/survey/survey.h"

namespace qmpipe {

// Where the survey took longer than place.keep_after_s, and there is a record: writes the lattice of
// the zooms in memory to the record's folder and counts those that are whole, so that the next run goes
// on from there. Of the sampling zoom, what is there; of another that is unfinished nothing, for it is
// reduced again sooner than read.
// What cannot be written is told as a note: the run ends as one that was stopped all the same.
void keep_survey(const Survey& survey, const MemoryShare& memory, const SurveyPlace& place,
                 Progress& progress);

// work(); where it is interrupted, the survey is kept first.
template <class Work>
auto keeping_survey(const Survey& survey, const MemoryShare& memory, const SurveyPlace& place,
                    Progress& progress, const Work& work) {
  try {
    return work();
  } catch (const Interrupted&) {
    keep_survey(survey, memory, place, progress);
    throw;
  }
}

}  // namespace qmpipe
