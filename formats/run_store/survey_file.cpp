#include "formats/run_store/survey_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "formats/bytes/byte_cursor.h"
#include "formats/bytes/file_bytes.h"
#include "formats/bytes/folders.h"
#include "formats/bytes/little_endian.h"
#include "formats/bytes/seal.h"
#include "scheduler/lattice.h"

namespace qmpipe {
namespace {

constexpr std::array<std::uint8_t, 8> kSurveyMagic = {'Q', 'M', 'S', 'U', 'R', 'V', '0', '2'};
constexpr std::size_t kHeadBytes = kSurveyMagic.size() + 6 * sizeof(std::int32_t);
constexpr std::size_t kTileBytes = 6 * sizeof(std::int32_t);
// All tiles of the deepest zoom that any machine could survey.
constexpr std::size_t kMostSurveyBytes = std::size_t{1} << 36U;
constexpr std::int32_t kMostPosts = kTilePosts * kTilePosts;

// Empty when the tile may stand in a survey.
std::string fault_of(const SurveyedTile& tile, const TilingScheme& scheme) {
  if (!scheme.contains(tile.key)) return "lies outside the tiling scheme";
  // Also true for what is no number.
  if (!(std::abs(tile.lowest_m) <= 1e30F && std::abs(tile.highest_m) <= 1e30F) ||
      tile.lowest_m > tile.highest_m) {
    return "has an impossible range of heights";
  }
  if (tile.valid_posts < 1 || tile.valid_posts > kMostPosts) {
    return "has an impossible number of valid posts";
  }
  if (!(tile.rim_m >= 0 && tile.rim_m <= 1e30F)) return "has an impossible rim";
  return "";
}

}  // namespace

std::filesystem::path survey_file_path(const std::filesystem::path& folder, std::int32_t zoom) {
  return folder / fmt::format("survey-{:02}.qms", zoom);
}

void write_survey_file(const std::filesystem::path& path, std::int32_t zoom,
                       const SurveyedZoom& surveyed) {
  std::vector<std::uint8_t> bytes(kSurveyMagic.begin(), kSurveyMagic.end());
  bytes.reserve(kHeadBytes + surveyed.tiles.size() * kTileBytes);
  append_little_endian(bytes, zoom);
  append_little_endian(bytes, static_cast<std::int32_t>(surveyed.tiles.size()));
  for (const std::optional<float>& height_m : surveyed.pole_heights_m) {
    append_little_endian(bytes, std::int32_t{height_m.has_value()});
    append_little_endian(bytes, height_m.value_or(0));
  }
  for (const SurveyedTile& tile : surveyed.tiles) {
    append_little_endian(bytes, tile.key.x);
    append_little_endian(bytes, tile.key.y);
    append_little_endian(bytes, tile.lowest_m);
    append_little_endian(bytes, tile.highest_m);
    append_little_endian(bytes, tile.valid_posts);
    append_little_endian(bytes, tile.rim_m);
  }
  append_seal(bytes, {});
  write_file_durably(path, bytes);
}

void remove_survey_files(const std::filesystem::path& folder) {
  for (std::int32_t zoom = 0; zoom <= kMaxZoom; ++zoom) {
    const std::filesystem::path path = survey_file_path(folder, zoom);
    remove_file(path);
    remove_file(path.string() + kTemporarySuffix);
  }
}

Result<SurveyedZoom> parse_surveyed_zoom(std::span<const std::uint8_t> bytes, std::int32_t zoom,
                                         const TilingScheme& scheme) {
  if (bytes.size() < kHeadBytes ||
      !std::equal(kSurveyMagic.begin(), kSurveyMagic.end(), bytes.begin())) {
    return Error{"it holds no survey of this version"};
  }
  ByteCursor numbers(bytes.subspan(kSurveyMagic.size()));
  if (numbers.next<std::int32_t>() != zoom) return Error{"it holds another zoom's survey"};
  const auto count = numbers.next<std::int32_t>();
  if (count < 0 || bytes.size() - kHeadBytes != static_cast<std::size_t>(count) * kTileBytes) {
    return Error{"its length does not fit its number of tiles"};
  }
  SurveyedZoom surveyed;
  for (std::optional<float>& height_m : surveyed.pole_heights_m) {
    const bool has_height = numbers.next<std::int32_t>() != 0;
    const auto value_m = numbers.next<float>();
    if (has_height) height_m = value_m;
  }
  surveyed.tiles.resize(static_cast<std::size_t>(count));
  const SurveyedTile* last = nullptr;
  for (SurveyedTile& tile : surveyed.tiles) {
    tile.key = {.zoom = zoom, .x = numbers.next<std::int32_t>(), .y = numbers.next<std::int32_t>()};
    tile.lowest_m = numbers.next<float>();
    tile.highest_m = numbers.next<float>();
    tile.valid_posts = numbers.next<std::int32_t>();
    tile.rim_m = numbers.next<float>();
    std::string fault = fault_of(tile, scheme);
    if (fault.empty() && last != nullptr && !(last->key < tile.key)) fault = "is out of order";
    if (!fault.empty()) return Error{fmt::format("tile {} {}", to_string(tile.key), fault)};
    last = &tile;
  }
  return surveyed;
}

Result<SurveyedZoom> read_survey_file(const std::filesystem::path& path, std::int32_t zoom,
                                      const TilingScheme& scheme) {
  if (const auto fault = check_seal(path)) return *fault;
  const auto bytes = read_file_bytes(path, kMostSurveyBytes);
  if (!bytes) return bytes.error();
  auto surveyed = parse_surveyed_zoom(without_seal(*bytes), zoom, scheme);
  if (!surveyed) return Error{fmt::format("{}: {}", path.string(), surveyed.error().message)};
  return surveyed;
}

}  // namespace qmpipe
