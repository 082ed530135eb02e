// What a user is told about the inputs, so that a wrong guess does not go unnoticed.
#pragma once

#include <vector>

#include "formats/sources/raster_source.h"
#include "pipeline/run/progress.h"

namespace qmpipe {

// Each assumption once, and above what heights are taken to be. REQUIRES: sources on the globe.
void note_sources(const std::vector<RasterInfo>& sources, Progress& progress);

// Once they were read: values that are most likely voids.
void note_findings(const HeightTally& tally, const HeightOptions& given, Progress& progress);

}  // namespace qmpipe
