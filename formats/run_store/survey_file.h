// What the survey learned about one zoom, in a file: so that an interrupted run need not read the
// whole lattice again to know it.
//
// Layout, little-endian: "QMSURV02", zoom (int32), number of tiles (int32), for the south and the
// north pole 1 or 0 (int32: has a height) and the height in metres (float32), then for each tile x, y
// (int32), lowest_m, highest_m (float32), valid_posts (int32), rim_m (float32); a seal
// (formats/bytes/seal.h).
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <vector>

#include "formats/bytes/result.h"
#include "scheduler/tiling_scheme.h"

namespace qmpipe {

// A tile with at least one valid post, and the range of its valid posts (257 x 257, sides included).
struct SurveyedTile {
  TileKey key;
  float lowest_m = 0;
  float highest_m = 0;
  std::int32_t valid_posts = 0;
  // How far from 0 m the valid posts next to a void reach; 0 where no void is next to one.
  float rim_m = 0;
  friend bool operator==(const SurveyedTile&, const SurveyedTile&) = default;
};

struct SurveyedZoom {
  std::vector<SurveyedTile> tiles;  // sorted by key
  // The one height of the south and the north pole row, where the data reach it.
  std::array<std::optional<float>, 2> pole_heights_m;
};

// survey-ZZ.qms
std::filesystem::path survey_file_path(const std::filesystem::path& folder, std::int32_t zoom);

// On return the file is on the disk. Throws IoError.
void write_survey_file(const std::filesystem::path& path, std::int32_t zoom,
                       const SurveyedZoom& surveyed);

// Of every zoom, and what interrupted writes of them left; other files stay. Throws IoError.
void remove_survey_files(const std::filesystem::path& folder);

// Refuses anything but what was written for this zoom; the message names the file.
Result<SurveyedZoom> read_survey_file(const std::filesystem::path& path, std::int32_t zoom,
                                      const TilingScheme& scheme);

// The bytes before the seal. Refuses tiles outside the scheme or out of order, and ranges that are
// none.
Result<SurveyedZoom> parse_surveyed_zoom(std::span<const std::uint8_t> bytes, std::int32_t zoom,
                                         const TilingScheme& scheme);

}  // namespace qmpipe
