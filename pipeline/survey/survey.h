// The first pass over the source: samples the posts of the sampling zoom, reduces them 2:1 down to
// zoom 0, and learns which tiles have data and how high they are.
//
// With a record, a zoom on disk is written down there when it is done, and one that an earlier run
// has done is not done again; of one that it was at, only the blocks that are missing.
// Guarantees: the lattice store it fills depends on the sources and the choice alone, not on threads, memory
// or interruptions. Throws IoError when a source cannot be read, Interrupted when
// asked to stop (what is on disk by then is sealed, and what is in memory kept where that is worth it).
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <vector>

#include "formats/heights/tally.h"
#include "formats/run_store/lattice_store.h"
#include "formats/run_store/survey_file.h"
#include "formats/sources/raster_source.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/run_record.h"
#include "pipeline/survey/choice.h"
#include "pipeline/survey/memory_share.h"
#include "stages/posts/heightfield.h"

namespace qmpipe {

// Where a survey keeps what it does.
struct SurveyPlace {
  // Of the zooms that are not kept in memory; needed when there is one. Empty, or the record's folder.
  std::filesystem::path store_folder = {};
  // DEFAULT: none; nothing is written down, and what the folder holds must be nothing.
  RunRecord* record = nullptr;
  // A run that is asked to stop keeps a survey that took longer (pipeline/survey/keep_survey.h), in seconds.
  double keep_after_s = std::numeric_limits<double>::infinity();
};

struct Survey {
  std::vector<RasterInfo> sources;
  TilingScheme scheme{Projection::kGeodetic};
  std::int32_t sampling_zoom = 0;
  std::int32_t max_zoom = 0;
  std::unique_ptr<LatticeStore> store;    // zooms 0..sampling_zoom
  LatticeStore* disk = nullptr;           // the part of it that is on disk, if there is one
  std::vector<PoleHeights> pole_heights;  // by zoom
  // By zoom 0..max_zoom, each sorted by key; pole rows alone do not make a tile.
  std::vector<std::vector<SurveyedTile>> tiles;
  SourceReads source_reads;
  double seconds = 0;
  // Deeper ones are done, and this one.
  std::int32_t coarsest_done = kMaxZoom + 1;
};

// What is written down of a zoom that is done.
SurveyedZoom zoom_of(const Survey& survey, std::int32_t zoom);

// `sources`: what describe_inputs() told. `tally`, where there is one, is shown the values that are read.
Survey run_survey(const SurveyChoice& choice, const MemoryShare& memory, const SurveyPlace& place,
                  std::vector<RasterInfo> sources, std::shared_ptr<HeightTally> tally,
                  Progress& progress);

}  // namespace qmpipe
