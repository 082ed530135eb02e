#include <fmt/format.h>

#include <algorithm>

#include "pipeline/verify/set.h"

namespace qmpipe::verify {
namespace {

bool is_listed(const CheckedLayer& layer, const char* extension) {
  const std::vector<std::string>& listed = layer.parsed->layer.extensions;
  return std::find(listed.begin(), listed.end(), extension) != listed.end();
}

std::string tally_text(const ExtensionTally& tally) {
  return fmt::format("{} of {} tiles", tally.with, tally.with + tally.without);
}

class ExtensionCheck {
 public:
  ExtensionCheck(const CheckedLayer& layer, const ExtensionTallies& tallies)
      : layer_(layer), tallies_(tallies) {}

  std::vector<Finding> run() {
    check_unlisted("octvertexnormals", "draw them unlit", tallies_.normals);
    check_unlisted("watermask", "show no water", tallies_.water_mask);
    check_normals();
    check_water_mask();
    check_metadata();
    return std::move(findings_);
  }

 private:
  void add(FindingKind kind, std::string text) {
    findings_.push_back({.kind = kind, .key = std::nullopt, .text = std::move(text)});
  }

  void check_unlisted(const char* extension, const char* consequence, const ExtensionTally& tally) {
    if (tally.with == 0 || is_listed(layer_, extension)) return;
    add(FindingKind::kExtensionNotListed,
        fmt::format(
            "{} carry {} (the first is {}), but \"extensions\" does not list it: clients {}",
            tally_text(tally), extension, to_string(*tally.first_with), consequence));
  }

  void check_normals() {
    const ExtensionTally& tally = tallies_.normals;
    if (tally.without == 0 || !is_listed(layer_, "octvertexnormals")) return;
    add(FindingKind::kExtensionAbsent,
        fmt::format("\"extensions\" lists octvertexnormals, but only {} carry them; the first "
                    "without is {}",
                    tally_text(tally), to_string(*tally.first_without)));
  }

  // A tile without a mask inherits its ancestor's, which may be meant.
  void check_water_mask() {
    const ExtensionTally& tally = tallies_.water_mask;
    if (tally.without == 0 || !is_listed(layer_, "watermask")) return;
    add(tally.with == 0 ? FindingKind::kExtensionAbsent : FindingKind::kPartialWaterMask,
        fmt::format("\"extensions\" lists watermask, but only {} carry one; the first without is "
                    "{}, which takes its ancestor's",
                    tally_text(tally), to_string(*tally.first_without)));
  }

  void check_metadata() {
    const ExtensionTally& due = tallies_.metadata_due;
    const ExtensionTally& elsewhere = tallies_.metadata_elsewhere;
    if (!layer_.parsed->metadata_availability) {
      if (elsewhere.with == 0) return;
      add(FindingKind::kMetadata,
          fmt::format("{} carry the metadata extension (the first is {}), but there is no "
                      "\"metadataAvailability\": CesiumJS fails on each of them",
                      tally_text(elsewhere), to_string(*elsewhere.first_with)));
    } else if (due.without > 0) {
      add(FindingKind::kMetadata,
          fmt::format("\"metadataAvailability\" is {}, but at the zooms it names only {} carry the "
                      "metadata extension; the first without is {}",
                      *layer_.parsed->metadata_availability, tally_text(due),
                      to_string(*due.first_without)));
    }
  }

  const CheckedLayer& layer_;
  const ExtensionTallies& tallies_;
  std::vector<Finding> findings_;
};

}  // namespace

void ExtensionTally::add(const TileKey& key, bool has_extension) {
  std::optional<TileKey>& first = has_extension ? first_with : first_without;
  ++(has_extension ? with : without);
  if (!first) first = key;
}

TileExtensions extensions_of(const QuantizedMesh& mesh) {
  return {.has_normals = !mesh.normals.empty(),
          .has_water_mask = !mesh.water_mask.empty(),
          .has_metadata = mesh.metadata_json.has_value()};
}

void add_tile(const CheckedLayer& layer, const TileKey& key, const TileExtensions& extensions,
              ExtensionTallies& tallies) {
  tallies.normals.add(key, extensions.has_normals);
  tallies.water_mask.add(key, extensions.has_water_mask);
  const std::int32_t levels = layer.parsed ? layer.parsed->metadata_availability.value_or(0) : 0;
  const bool is_due = levels > 0 && key.zoom % levels == 0;
  (is_due ? tallies.metadata_due : tallies.metadata_elsewhere).add(key, extensions.has_metadata);
}

std::vector<Finding> check_extensions(const CheckedLayer& layer, const ExtensionTallies& tallies) {
  if (!layer.parsed) return {};
  return ExtensionCheck(layer, tallies).run();
}

}  // namespace qmpipe::verify
