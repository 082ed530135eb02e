// What a survey is asked for: which sources, read how, and to which depth. Its posts depend on this alone; how much
// memory and disk it has for them is said elsewhere (pipeline/survey/memory_share.h, pipeline/survey/survey.h).
#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "formats/raster/height_options.h"
#include "formats/sources/raster_source.h"
#include "formats/sources/source_pool.h"
#include "scheduler/tiling_scheme.h"
#include "stages/posts/reduce.h"
#include "stages/posts/sampling.h"

namespace qmpipe {

struct SurveyChoice {
  std::vector<std::string> inputs = {};  // in order of priority
  std::string source_crs = {};           // overrides the inputs' CRS when not empty
  HeightOptions heights = {};            // of the inputs
  Resampling resampling = Resampling::kBilinear;
  Reduction reduction = Reduction::kMean;
  TilingScheme scheme{Projection::kGeodetic};
  // -1: chosen from the sources' pixels (sampling_zoom_for), deepened to at least max_zoom.
  std::int32_t sampling_zoom = -1;
  // Deepest zoom for which tiles are listed; -1: the sampling zoom.
  std::int32_t max_zoom = -1;
  // At most; memory may allow fewer for sampling.
  std::int32_t threads = 1;
  // How many sources each of the threads may have open.
  std::size_t open_sources = sources_open_at_once(1);
};

// The zoom whose posts are sampled for these sources.
std::int32_t chosen_sampling_zoom(const SurveyChoice& choice,
                                  const std::vector<RasterInfo>& sources);

// Opens the inputs to learn about them, and which of them lie on one grid: throws IoError for one that cannot be
// used, UsageError when there is none.
std::vector<RasterInfo> describe_inputs(const SurveyChoice& choice);

}  // namespace qmpipe
