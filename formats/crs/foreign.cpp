#include "formats/crs/foreign.h"

#include <ogr_spatialref.h>

#include <algorithm>
#include <array>

#include "formats/bytes/letter_case.h"
#include "formats/crs/gdal_session.h"
#include "formats/crs/paths.h"
#include "formats/crs/wkt.h"

namespace qmpipe {
namespace {

constexpr std::size_t kLongestText = 65536;

// PROJ's ways to other files: grids of a datum shift (of PROJ strings, or PROJ4_GRIDS of WKT), tables
// of definitions, files of parameters, meshes and models.
bool names_files(const std::string& text) {
  static constexpr std::array<const char*, 7> kWays = {
      "grids=", "proj4_grids", "init=", "file=", "catalog=", "parameterfile", "model="};
  const std::string words = lower_case(text);
  return path_in_crs(text) || std::any_of(kWays.begin(), kWays.end(), [&words](const char* way) {
           return words.find(way) != std::string::npos;
         });
}

}  // namespace

std::optional<Error> fault_of_foreign_crs(const std::string& text) {
  // Before it is parsed: PROJ opens such files while it parses.
  if (text.size() > kLongestText || text.find('\0') != std::string::npos || names_files(text)) {
    return Error{"names files or is too long"};
  }
  const GdalSession session;
  OGRSpatialReference crs;
  const std::array<const char*, 3> options = {"ALLOW_NETWORK_ACCESS=NO", "ALLOW_FILE_ACCESS=NO",
                                              nullptr};
  if (crs.SetFromUserInput(text.c_str(), options.data()) != OGRERR_NONE) {
    return Error{"is no CRS by itself"};
  }
  if (names_files(wkt_of(crs))) return Error{"names files"};
  return std::nullopt;
}

}  // namespace qmpipe
