#include "formats/tile/layer_json.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <set>

namespace qmpipe::layer_json_test {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

auto complaint_of(LayerFlaw flaw, const char* part) {
  return AllOf(Field(&LayerComplaint::flaw, flaw), Field(&LayerComplaint::text, HasSubstr(part)));
}

LayerJson example() {
  LayerJson layer;
  layer.name = "Bay \"of\" Bengal \n \xC3\xA9";
  layer.attribution = "(c) us";
  layer.extensions = {"octvertexnormals"};
  layer.max_zoom = 2;
  layer.bounds_deg = {.west_deg = -180, .south_deg = -0.1, .east_deg = 1.0 / 3, .north_deg = 90};
  layer.available = {{{0, 0, 1, 0}}, {}, {{1, 1, 2, 2}, {4, 0, 4, 3}}};
  layer.qmpipe_json = R"({"z":1,"a":[0.1,{"deep":"x\ny"}],"tolerance_m":0.30000000000000004})";
  return layer;
}

TEST(LayerJson, WhatIsWrittenIsReadBackEqual) {
  LayerJson layer = example();
  for (int round = 0; round < 4; ++round) {
    const auto parsed = parse_layer_json(write_layer_json(layer));
    ASSERT_TRUE(parsed.ok()) << parsed.error().message;
    EXPECT_EQ(parsed->layer, layer);
    EXPECT_THAT(parsed->complaints, IsEmpty());
    EXPECT_TRUE(parsed->has_max_zoom);
    EXPECT_EQ(parsed->format, "quantized-mesh-1.0");
    EXPECT_EQ(parsed->scheme, "tms");
    if (round == 0) layer.description = "with a description";
    if (round == 1) layer.projection = Projection::kMercator, layer.available = {{{0, 0, 0, 0}}};
    if (round == 2) layer = LayerJson(), layer.version = "";
  }
}

TEST(LayerJson, TheTextStaysAsItIs) {
  EXPECT_EQ(write_layer_json(example()), R"({
  "tilejson": "2.1.0",
  "name": "Bay \"of\" Bengal \n é",
  "version": "1.0.0",
  "format": "quantized-mesh-1.0",
  "attribution": "(c) us",
  "scheme": "tms",
  "projection": "EPSG:4326",
  "extensions": ["octvertexnormals"],
  "tiles": ["{z}/{x}/{y}.terrain?v={version}"],
  "minzoom": 0,
  "maxzoom": 2,
  "bounds": [-180.0, -0.1, 0.3333333333333333, 90.0],
  "available": [
    [
      {"startX": 0, "startY": 0, "endX": 1, "endY": 0}
    ],
    [],
    [
      {"startX": 1, "startY": 1, "endX": 2, "endY": 2},
      {"startX": 4, "startY": 0, "endX": 4, "endY": 3}
    ]
  ],
  "qmpipe": {
    "z": 1,
    "a": [
      0.1,
      {
        "deep": "x\ny"
      }
    ],
    "tolerance_m": 0.30000000000000004
  }
}
)");
}

TEST(LayerJson, BytesThatAreNoUtf8DoNotSpoilTheFile) {
  LayerJson layer = example();
  layer.name = "caf\xE9";
  const auto parsed = parse_layer_json(write_layer_json(layer));
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  EXPECT_EQ(parsed->layer.name, "caf\xEF\xBF\xBD");
}

TEST(LayerJson, OtherProgramsSetsAreReadWithComplaints) {
  const auto parsed = parse_layer_json(
      R"({"schema":"tms","tiles":["{z}/{x}/{y}.terrain"],"maxzoom":0.0,"zebra":[1],
          "available":[[{"startX":0,"startY":0,"endX":1,"endY":0}],
                       [{"startX":3,"startY":0,"endX":1,"endY":0},
                        {"startX":0,"startY":0,"endX":9,"endY":0}]]})");
  ASSERT_TRUE(parsed.ok()) << parsed.error().message;
  EXPECT_EQ(parsed->scheme, "tms");
  EXPECT_EQ(parsed->layer.max_zoom, 0);
  EXPECT_EQ(parsed->layer.available[1].size(), 2U);
  const std::vector<LayerComplaint>& complaints = parsed->complaints;
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kSchemaForScheme,
                                                "\"schema\" stands where \"scheme\"")));
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kNoFormat, "no \"format\"")));
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kNoVersion, "no \"version\"")));
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kNoBounds, "no \"bounds\"")));
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kRanges,
                                                "2 ranges of zoom 1 are reversed or outside")));
  EXPECT_THAT(complaints, Contains(complaint_of(LayerFlaw::kDeepestZoom, "\"maxzoom\" is 0, but")));
}

TEST(LayerJson, AnEmptyObjectIsReadWithComplaints) {
  const auto parsed = parse_layer_json("{}");
  ASSERT_TRUE(parsed.ok());
  EXPECT_THAT(parsed->complaints, Contains(complaint_of(LayerFlaw::kNoTiles, "no \"tiles\"")));
  EXPECT_THAT(parsed->complaints,
              Contains(complaint_of(LayerFlaw::kNoAvailability, "shows no tile")));
  EXPECT_THAT(parsed->complaints, Contains(complaint_of(LayerFlaw::kNoMaxZoom, "no \"maxzoom\"")));
  EXPECT_FALSE(parsed->metadata_availability.has_value());
}

TEST(LayerJson, IllTypedKeysAreRefusedByName) {
  const auto fault = [](const std::string& text) {
    const auto parsed = parse_layer_json(text);
    return parsed.ok() ? std::string("parsed") : parsed.error().message;
  };
  EXPECT_THAT(fault("[]"), HasSubstr("no JSON object"));
  EXPECT_THAT(fault("{\"a\": tru}"), HasSubstr("no valid JSON at byte 10"));
  EXPECT_THAT(fault(""), HasSubstr("no valid JSON"));
  EXPECT_THAT(fault("{} x"), HasSubstr("no valid JSON"));
  EXPECT_THAT(fault("{\"maxzoom\": 1e999}"), HasSubstr("no valid JSON"));
  EXPECT_THAT(fault(R"({"name": 3})"), HasSubstr("\"name\" is number, not a text"));
  EXPECT_THAT(fault(R"({"tiles": "x"})"), HasSubstr("\"tiles\" is no list"));
  EXPECT_THAT(fault(R"({"maxzoom": 1.5})"), HasSubstr("\"maxzoom\" is no whole number"));
  EXPECT_THAT(fault(R"({"maxzoom": 99999999999})"), HasSubstr("\"maxzoom\" is no whole number"));
  EXPECT_THAT(fault(R"({"bounds": [1, 2, 3]})"), HasSubstr("\"bounds\" is no list of four"));
  EXPECT_THAT(fault(R"({"available": [3]})"), HasSubstr("no list of lists"));
  EXPECT_THAT(fault(R"({"available": [[3]]})"), HasSubstr("no list of lists"));
  EXPECT_THAT(fault(R"({"available": [[{"startX": 0}]]})"), HasSubstr("has no \"startY\""));
  EXPECT_THAT(fault(R"({"projection": "EPSG:2056"})"), HasSubstr("EPSG:2056"));
  EXPECT_THAT(fault(R"({"qmpipe": 1})"), HasSubstr("\"qmpipe\" is no object"));
}

TEST(LayerJson, NestingAndKeysThatWouldChokeUsAreRefused) {
  const std::string deep(100000, '[');
  const auto parsed = parse_layer_json("{\"qmpipe\":" + deep);
  ASSERT_FALSE(parsed.ok());
  EXPECT_THAT(parsed.error().message, HasSubstr("nested deeper than 64"));
  std::string many = "{";
  for (int i = 0; i < 2000; ++i) many.append("\"").append(std::to_string(i)).append("\":1,");
  EXPECT_THAT(parse_layer_json(many + "\"x\":1}").error().message, HasSubstr("1000 keys"));
}

using Cells = std::set<TileKey>;

Cells cells_of(const std::vector<TileRange>& ranges, std::int32_t zoom, bool& overlap) {
  Cells cells;
  for (const TileRange& range : ranges) {
    for (std::int32_t y = range.start_y; y <= range.end_y; ++y) {
      for (std::int32_t x = range.start_x; x <= range.end_x; ++x) {
        overlap |= !cells.insert({.zoom = zoom, .x = x, .y = y}).second;
      }
    }
  }
  return cells;
}

TEST(MergeRanges, RandomSetsAreCoveredExactlyOnce) {
  for (std::uint64_t seed = 1; seed <= 500; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto width = static_cast<std::int32_t>(1 + random() % 20);
    const auto height = static_cast<std::int32_t>(1 + random() % 20);
    const std::uint64_t percent = 1 + random() % 100;
    Cells wanted;
    for (std::int32_t y = 0; y < height; ++y) {
      for (std::int32_t x = 0; x < width; ++x) {
        if (random() % 100 < percent) wanted.insert({.zoom = 5, .x = x, .y = y});
      }
    }
    const std::vector<TileKey> keys(wanted.begin(), wanted.end());
    bool overlap = false;
    EXPECT_EQ(cells_of(merge_ranges(keys), 5, overlap), wanted);
    EXPECT_FALSE(overlap);
  }
}

TEST(MergeRanges, RectanglesBecomeOneRangeEach) {
  std::vector<TileKey> keys;
  for (std::int32_t y = 0; y < 40; ++y) {
    for (std::int32_t x = 0; x < 300; ++x) {
      // A tall and a wide one, side by side.
      if (x < 10 || (x >= 20 && y < 30)) keys.push_back({.zoom = 9, .x = x, .y = y});
    }
  }
  EXPECT_THAT(merge_ranges(keys),
              ::testing::UnorderedElementsAre(TileRange{0, 0, 9, 39}, TileRange{20, 0, 299, 29}));
  EXPECT_THAT(merge_ranges({}), IsEmpty());
}

TEST(MergeRanges, AStaircaseIsTakenTheWayThatNeedsFewerRanges) {
  // Columns of different heights: by rows 8 ranges or more, by columns 4.
  std::vector<TileKey> keys;
  for (std::int32_t y = 0; y < 8; ++y) {
    for (std::int32_t x : {0, 2, 4, 6}) {
      if (y <= x + 1) keys.push_back({.zoom = 9, .x = x, .y = y});
    }
  }
  EXPECT_EQ(merge_ranges(keys).size(), 4U);
}

TEST(MergeRanges, UnsortedKeysAreABug) {
  const std::vector<TileKey> keys = {{.zoom = 1, .x = 1, .y = 0}, {.zoom = 1, .x = 0, .y = 0}};
  EXPECT_THROW(merge_ranges(keys), InternalError);
}

}  // namespace
}  // namespace qmpipe::layer_json_test
