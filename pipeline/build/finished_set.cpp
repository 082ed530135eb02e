#include "pipeline/build/finished_set.h"

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <utility>

#include "formats/bytes/file_bytes.h"
#include "formats/mbtiles/set.h"
#include "formats/tile_sets/open_tile_set.h"
#include "formats/tile_sets/tile_output.h"
#include "pipeline/recipe/fingerprint.h"

namespace qmpipe {
namespace {

constexpr std::size_t kMostReportBytes = std::size_t{64} << 20U;

// None when it is no JSON object with these members.
struct ReadReport {
  std::string built_from;
  std::string layer_version;
  std::int64_t tiles = 0;
};

std::optional<ReadReport> read_report(const std::string& text) try {
  const nlohmann::json report = nlohmann::json::parse(text);
  return ReadReport{.built_from = report.at("built_from").dump(),
                    .layer_version = report.at("layer_version").get<std::string>(),
                    .tiles = report.at("tiles").get<std::int64_t>()};
} catch (const nlohmann::json::exception&) {
  return std::nullopt;
}

// The set in the output, when it has a layer.json.
std::unique_ptr<TileSet> set_in(const std::filesystem::path& output) {
  std::error_code code;
  if (form_of(output) == TileForm::kFolder) {
    return std::filesystem::is_regular_file(output / "layer.json", code) ? open_tile_set(output)
                                                                         : nullptr;
  }
  auto tiles = read_mbtiles(output, RowOrder::kTms);
  return tiles ? std::move(tiles.value()) : nullptr;
}

bool has_version(const TileSet& tiles, const std::string& version) {
  const Result<std::string> text = tiles.layer_text();
  if (!text) return false;
  const Result<ParsedLayerJson> parsed = parse_layer_json(*text);
  return parsed && parsed->layer.version == version;
}

}  // namespace

std::optional<FinishedSet> finished_set(const BuildOptions& options) {
  const std::filesystem::path& output = options.output.path;
  const auto bytes = read_file_bytes(report_path(output), kMostReportBytes);
  if (!bytes) return std::nullopt;
  FinishedSet set{
      .report_json = std::string(bytes->begin(), bytes->end()), .tiles = 0, .differences = {}};
  const auto report = read_report(set.report_json);
  if (!report) return std::nullopt;
  const std::unique_ptr<TileSet> tiles = set_in(output);
  if (tiles == nullptr || !has_version(*tiles, report->layer_version)) return std::nullopt;
  set.tiles = report->tiles;
  set.differences = provenance_differences(report->built_from, provenance_of(options));
  if (std::cmp_not_equal(tiles->keys().size(), report->tiles)) {
    set.differences.push_back(fmt::format("{} tiles are there of the {} that it was built with",
                                          tiles->keys().size(), report->tiles));
  }
  return set;
}

}  // namespace qmpipe
