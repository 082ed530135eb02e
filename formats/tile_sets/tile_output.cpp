#include "formats/tile_sets/tile_output.h"

#include <algorithm>
#include <string>
#include <system_error>

#include "formats/bytes/errors.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/letter_case.h"
#include "formats/mbtiles/mbtiles.h"
#include "formats/tile_sets/folder_sink.h"

namespace qmpipe {
namespace {

[[noreturn]] void refuse_pmtiles(const std::filesystem::path& output) {
  std::filesystem::path packed = output;
  packed.replace_extension(".mbtiles");
  throw UsageError(output.string() +
                   ": a PMTiles file is packed from a finished tile set, in an order that no build "
                   "keeps; build " +
                   packed.string() + ", then: qmpipe convert " + packed.string() + " -o " +
                   output.string());
}

}  // namespace

TileForm form_of(const std::filesystem::path& output) {
  const std::string extension = lower_case(output.extension().string());
  if (extension == ".mbtiles") return TileForm::kMbtiles;
  if (extension == ".pmtiles") return TileForm::kPmtiles;
  return TileForm::kFolder;
}

std::unique_ptr<TileSink> open_tile_sink(const std::filesystem::path& output, Overwrite overwrite) {
  switch (form_of(output)) {
    case TileForm::kFolder:
      return open_folder_sink(output, overwrite);
    case TileForm::kMbtiles:
      return open_mbtiles_sink(output, overwrite);
    case TileForm::kPmtiles:
      break;
  }
  refuse_pmtiles(output);
}

std::unique_ptr<TileSink> resume_tile_sink(const std::filesystem::path& output) {
  switch (form_of(output)) {
    case TileForm::kFolder:
      return resume_folder_sink(output);
    case TileForm::kMbtiles:
      return resume_mbtiles_sink(output);
    case TileForm::kPmtiles:
      break;
  }
  refuse_pmtiles(output);
}

bool may_hold_tiles(const std::filesystem::path& output) {
  const bool is_folder = form_of(output) == TileForm::kFolder;
  std::error_code code;
  const std::filesystem::path place =
      is_folder ? output : std::filesystem::path(output.string() + kTemporarySuffix);
  const bool is_there = std::filesystem::exists(place, code);
  if (code || !is_there) return static_cast<bool>(code);
  if (!is_folder) return true;
  const bool is_empty = std::filesystem::is_empty(place, code);
  return code || !is_empty;
}

std::filesystem::path report_path(const std::filesystem::path& output) {
  if (form_of(output) == TileForm::kFolder) return output / "report.json";
  return output.string() + ".report.json";
}

}  // namespace qmpipe
