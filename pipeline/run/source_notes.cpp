#include "pipeline/run/source_notes.h"

#include <algorithm>
#include <set>
#include <string>

namespace qmpipe {

void note_sources(const std::vector<RasterInfo>& sources, Progress& progress) {
  std::set<std::string> said;
  for (const RasterInfo& source : sources) {
    for (const std::string& assumption : source.assumptions) {
      if (said.insert(assumption).second) progress.note(source.path + ": " + assumption);
    }
  }
  std::set<std::string> datums;
  for (const RasterInfo& source : sources) {
    if (source.band.reference != HeightReference::kDatum) continue;
    if (!datums.insert(source.band.vertical_name).second) continue;
    progress.note(source.path + ": heights are written as they are, above '" +
                  source.band.vertical_name +
                  "': nothing is converted to heights above the WGS84 ellipsoid, which tiles are "
                  "made of (they will stand off by the geoid's height, up to 100 m)");
  }
  if (std::any_of(sources.begin(), sources.end(), [](const RasterInfo& source) {
        return source.band.reference == HeightReference::kUnknown;
      })) {
    progress.note(
        "heights are written as they are: the input names no vertical datum, so they are taken as "
        "heights above the WGS84 ellipsoid (heights above sea level will stand off by the geoid's "
        "height, up to 100 m)");
  }
}

void note_findings(const HeightTally& tally, const HeightOptions& given, Progress& progress) {
  for (const HeightFinding& finding : tally.findings(given)) {
    progress.note(finding.path + ": " + finding.text);
  }
}

}  // namespace qmpipe
