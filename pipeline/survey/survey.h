// The first pass over the source: samples the posts of the sampling zoom, reduces them 2:1 down to
// zoom 0, and learns which tiles have data and how high they are.
//
// With a record, a zoom on disk is written down there when it is done, and one that an earlier run
// has done is not done again; of one that it was at, only the blocks that are missing.
// Guarantees: the lattice store it fills depends on the sources, the scheme and the options alone,
// not on threads or interruptions. Throws IoError when a source cannot be read, Interrupted when
// asked to stop (what is on disk by then is sealed, and what is in memory kept where that is worth it).
#pragma once

#include <cstdint>
#include <filesystem>
#include <limits>
#include <memory>
#include <string>
#include <vector>

#include "formats/run_store/lattice_store.h"
#include "formats/run_store/survey_file.h"
#include "formats/sources/raster_source.h"
#include "formats/sources/source_pool.h"
#include "pipeline/run/progress.h"
#include "pipeline/run/run_record.h"
#include "stages/posts/heightfield.h"
#include "stages/posts/reduce.h"
#include "stages/posts/sampling.h"

namespace qmpipe {

struct SurveyOptions {
  std::vector<std::string> inputs = {};  // in order of priority
  std::string source_crs = {};           // overrides the inputs' CRS when not empty
  HeightOptions heights = {};            // of the inputs
  // Is shown the values that are read. DEFAULT: none.
  std::shared_ptr<HeightTally> tally = {};
  Resampling resampling = Resampling::kBilinear;
  Reduction reduction = Reduction::kMean;
  TilingScheme scheme{Projection::kGeodetic};
  // -1: chosen from the sources' pixels (sampling_zoom_for), deepened to at least max_zoom.
  std::int32_t sampling_zoom = -1;
  // Deepest zoom for which tiles are listed; -1: the sampling zoom.
  std::int32_t max_zoom = -1;
  std::int32_t threads = 1;
  // How many sources each of the threads may have open.
  std::size_t open_sources = sources_open_at_once(1);
  // Deeper zooms than this are kept on disk, compressed; -1 keeps all there. DEFAULT: all in memory.
  std::int32_t last_memory_zoom = kMaxZoom;
  // Where the store on disk lives; needed when a zoom is kept there. Empty, or the record's folder.
  std::filesystem::path store_folder = {};
  // Bounds the blocks that are kept in memory after they were read back from there.
  std::int64_t block_cache_bytes = 16LL << 20U;
  // DEFAULT: none; nothing is written down, and what the folder holds must be nothing.
  RunRecord* record = nullptr;
  // A run that is asked to stop keeps a survey that took longer (pipeline/survey/keep_survey.h), in seconds.
  double keep_after_s = std::numeric_limits<double>::infinity();
  // Bounds the decoded source blocks that the threads share while they sample.
  std::int64_t source_cache_bytes = 256LL << 20U;
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

// The sampling zoom that run_survey() will use for these sources.
std::int32_t chosen_sampling_zoom(const SurveyOptions& options,
                                  const std::vector<RasterInfo>& sources);

// Opens the inputs to learn about them, and which of them lie on one grid: throws IoError for one that cannot be used, UsageError when
// there is none.
std::vector<RasterInfo> describe_inputs(const SurveyOptions& options);

// `sources`: what describe_inputs() told.
Survey run_survey(const SurveyOptions& options, std::vector<RasterInfo> sources,
                  Progress& progress);

}  // namespace qmpipe
