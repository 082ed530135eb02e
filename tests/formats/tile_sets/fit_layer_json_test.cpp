#include "formats/tile_sets/fit_layer_json.h"
#include "formats/tile_sets/open_tile_set.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>

#include "tests/support/verify_fixture.h"

namespace qmpipe::testing::fit_layer_json_test {
namespace {

using nlohmann::json;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

FittedLayer fit(const SetFixture& set) {
  return fit_layer_json(*open_tile_set(set.path()), "some name");
}

std::string own_text(const SetFixture& set) { return *open_tile_set(set.path())->layer_text(); }

TEST(FitLayerJson, LeavesASoundOneAloneByteForByte) {
  const SetFixture set(sixteen_tiles());
  const FittedLayer fitted = fit(set);
  EXPECT_THAT(fitted.changes, IsEmpty());
  EXPECT_EQ(fitted.text, own_text(set));
}

TEST(FitLayerJson, MakesOneFromTheTilesWhereThereIsNone) {
  const SetFixture set(sixteen_tiles());
  const json before = json::parse(own_text(set));
  std::filesystem::remove(set.path() / "layer.json");
  const FittedLayer fitted = fit(set);
  EXPECT_THAT(fitted.changes, ElementsAre(HasSubstr("made from the tiles")));
  const json after = json::parse(fitted.text);
  for (const char* key : {"available", "maxzoom", "extensions", "format", "scheme", "projection"}) {
    EXPECT_EQ(after[key], before[key]) << key;
  }
  EXPECT_EQ(after["name"], "some name");
  EXPECT_THAT(parse_layer_json(fitted.text)->complaints, IsEmpty());
}

TEST(FitLayerJson, TellsMercatorTilesFromGeodeticOnesWithoutALayerJson) {
  SetPlan plan = sixteen_tiles();
  plan.scheme = TilingScheme(Projection::kMercator);
  plan.heights = smooth_globe(plan.scheme);
  std::erase_if(plan.keys, [&](const TileKey& key) { return !plan.scheme.contains(key); });
  const SetFixture set(plan);
  std::filesystem::remove(set.path() / "layer.json");
  EXPECT_EQ(json::parse(fit(set).text)["projection"], "EPSG:3857");
}

TEST(FitLayerJson, PutsRightWhatClientsStumbleOverAndKeepsTheRest) {
  const SetFixture set(sixteen_tiles());
  json layer = json::parse(own_text(set));
  const json sound = layer;
  layer["schema"] = layer["scheme"];
  layer.erase("scheme");
  layer["tiles"] = {"https://elsewhere.example/{z}/{x}/{y}.terrain"};
  layer["maxzoom"] = 1;
  layer["extensions"] = json::array();
  layer["available"][2] = json::array();
  layer["bespoke"] = {{"kept", true}};
  set.put("layer.json", layer.dump());
  const FittedLayer fitted = fit(set);
  EXPECT_THAT(fitted.changes,
              ElementsAre(HasSubstr("scheme"), HasSubstr("tiles"), HasSubstr("available"),
                          HasSubstr("maxzoom"), HasSubstr("octvertexnormals")));
  const json after = json::parse(fitted.text);
  EXPECT_FALSE(after.contains("schema"));
  EXPECT_EQ(after["scheme"], "tms");
  EXPECT_EQ(after["tiles"], json::array({"{z}/{x}/{y}.terrain?v={version}"}));
  EXPECT_EQ(after["maxzoom"], sound["maxzoom"]);
  EXPECT_EQ(after["extensions"], sound["extensions"]);
  EXPECT_EQ(after["bespoke"], layer["bespoke"]);
  // The ranges may be cut otherwise; what they cover is what counts.
  set.put("layer.json", fitted.text);
  EXPECT_THAT(fit(set).changes, IsEmpty());
}

TEST(FitLayerJson, AvailabilityInTheTilesIsLeftToThem) {
  const SetFixture set(sixteen_tiles());
  json layer = json::parse(own_text(set));
  layer.erase("available");
  layer["metadataAvailability"] = 4;
  set.put("layer.json", layer.dump());
  EXPECT_THAT(fit(set).changes, IsEmpty());
}

TEST(FitLayerJson, TilesNumberedFromTheNorthAreListedFromTheSouth) {
  const SetFixture set(sixteen_tiles());
  json layer = json::parse(own_text(set));
  layer["scheme"] = "slippyMap";
  const FittedLayer unflipped = [&] {
    set.put("layer.json", layer.dump());
    return fit(set);
  }();
  // The files' names are as before, so what they listed was the other way up.
  EXPECT_THAT(unflipped.changes, ElementsAre(HasSubstr("available")));
  const auto available = parse_layer_json(unflipped.text)->layer.available;
  EXPECT_THAT(
      available[3],
      ElementsAre(TileRange{
          .start_x = kLeaf.x, .start_y = 7 - kLeaf.y, .end_x = kLeaf.x, .end_y = 7 - kLeaf.y}));
}

TEST(FitLayerJson, HugeOrReversedRangesAreReplacedWithoutBeingWalked) {
  const SetFixture set(sixteen_tiles());
  json layer = json::parse(own_text(set));
  const json sound = layer["available"];
  layer["available"][1] = {{{"startX", -2147483647},
                            {"startY", -2147483647},
                            {"endX", 2147483647},
                            {"endY", 2147483647}}};
  layer["available"][2] = {{{"startX", 3}, {"startY", 3}, {"endX", 0}, {"endY", 0}}};
  set.put("layer.json", layer.dump());
  EXPECT_EQ(json::parse(fit(set).text)["available"], sound);
}

}  // namespace
}  // namespace qmpipe::testing::fit_layer_json_test
