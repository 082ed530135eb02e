#include "pipeline/recipe/method.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>

#include "formats/bytes/errors.h"
#include "tests/support/temporary_folder.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::method_test {
namespace {

using ::testing::HasSubstr;

ZoomSeries parsed(const std::string& text) { return ZoomSeries::parse(text).value(); }

// The message of the UsageError that `act` throws; empty when it throws none.
template <class Act>
std::string refusal(const Act& act) {
  try {
    act();
  } catch (const UsageError& error) {
    return error.what();
  }
  return "";
}

std::vector<std::string> names_of(Method method, Stop stop) {
  std::vector<std::string> names;
  for (const ParameterInfo& info : parameters_of(method, stop)) names.emplace_back(info.name);
  return names;
}

TEST(ZoomSeries, FollowsItsTextOverTheZooms) {
  EXPECT_EQ(parsed("10").at(0), 10);
  EXPECT_EQ(parsed("10").at(21), 10);
  EXPECT_EQ(parsed("15000/2").at(10), 15000.0 / 1024);
  EXPECT_EQ(parsed("3*2").at(4), 48);
  const ZoomSeries listed = parsed("5000,4000,1000");
  EXPECT_EQ(listed.at(1), 4000);
  EXPECT_EQ(listed.at(2), 1000);
  EXPECT_EQ(listed.at(9), 1000);
  EXPECT_EQ(parsed("7,8/2").at(3), 2);
}

TEST(ZoomSeries, TextsReadBackEqual) {
  for (const char* text : {"10", "15000/2", "3*2", "5000,5000,1000", "1e-10", "7,8.5/2"}) {
    EXPECT_EQ(parsed(text).text(), text);
    EXPECT_EQ(parsed(parsed(text).text()), parsed(text));
  }
}

TEST(ZoomSeries, WhatIsNoNumberIsRefused) {
  for (const char* text :
       {"", "x", "1,", ",1", "1,,2", "/2", "1/3", "1/2/2", "nan", "inf", "1 2"}) {
    EXPECT_FALSE(ZoomSeries::parse(text)) << text;
  }
}

TEST(MethodParameters, DefaultsAreTheTableOfThePaper) {
  const MethodParameters parameters;
  const auto at = [&](const char* name, std::int32_t zoom) { return parameters.of(name).at(zoom); };
  EXPECT_NEAR(at("g_e", 10), 14.65, 0.01);
  EXPECT_EQ(at("e_e", 3), 5000);
  EXPECT_EQ(at("e_e", 4), 1000);
  EXPECT_EQ(at("e_s", 0), 1e-10);
  EXPECT_EQ(at("p_e", 10), 1);
  EXPECT_NEAR(at("d_g", 9), 976.56, 0.01);
  EXPECT_EQ(at("h_c", 5), 100);
  EXPECT_EQ(at("h_c", 6), 50);
  EXPECT_EQ(at("w_p", 3), 1);
  EXPECT_EQ(at("w_p", 4), 5);
  EXPECT_EQ(at("w_p", 6), 25);
  EXPECT_EQ(at("w_r", 10), 5);
}

TEST(MethodParameters, EveryMethodHasItsOwn) {
  using ::testing::ElementsAre;
  EXPECT_THAT(names_of(Method::kGreedy, Stop::kTolerance), ElementsAre("g_e", "g_g"));
  EXPECT_THAT(names_of(Method::kEdgeCollapse, Stop::kEdges),
              ElementsAre("e_e", "e_v", "e_b", "e_s"));
  EXPECT_THAT(names_of(Method::kEdgeCollapse, Stop::kTolerance),
              ElementsAre("g_e", "e_v", "e_b", "e_s"));
  EXPECT_THAT(names_of(Method::kPsHierarchy, Stop::kTolerance),
              ElementsAre("p_e", "p_b", "p_m", "h_c", "h_v"));
  EXPECT_THAT(names_of(Method::kPsWlop, Stop::kTolerance),
              ElementsAre("p_e", "p_b", "p_m", "w_p", "w_r", "w_i"));
  for (const Method method : kMethods) EXPECT_EQ(method_named(name_of(method)).value(), method);
  EXPECT_FALSE(method_named("ps"));
  EXPECT_FALSE(stop_named("Edges"));
}

TEST(MethodParameters, ValuesOutOfRangeAreRefusedByName) {
  MethodParameters parameters;
  EXPECT_THAT(refusal([&] { parameters.set("g_e", ZoomSeries({0})); }), HasSubstr("g_e: 0 cannot"));
  EXPECT_THAT(refusal([&] { parameters.set("p_m", ZoomSeries({2.5})); }), HasSubstr("whole"));
  EXPECT_THAT(refusal([&] { parameters.set("r_r", ZoomSeries({50, 101})); }), HasSubstr("101"));
  EXPECT_THAT(refusal([&] { parameters.set("q", ZoomSeries({1})); }), HasSubstr("g_e, g_g, e_e"));
  // Doubled out of its range at a deeper zoom only.
  parameters.set("r_r", ZoomSeries({40}, 2));
  EXPECT_EQ(values_at(parameters, Method::kPsRandom, Stop::kTolerance, 1).at("r_r"), 80);
  EXPECT_THAT(refusal([&] { values_at(parameters, Method::kPsRandom, Stop::kTolerance, 2); }),
              HasSubstr("r_r at zoom 2: 160"));
}

TEST(MethodParameters, ValuesReachTheStages) {
  MethodParameters parameters;
  parameters.set("e_e", ZoomSeries({77}));
  parameters.set("h_c", ZoomSeries({9}));
  const MethodFrame frame = {.height_steps = 0.5, .curvature = Curvature::kIgnored, .seed = 5};
  const auto options = [&](Method method, Stop stop) {
    return method_options(method, stop, values_at(parameters, method, stop, 0), frame);
  };
  const auto edges = std::get<EdgeCollapseOptions>(options(Method::kEdgeCollapse, Stop::kEdges));
  EXPECT_EQ(edges.least_edges, 77);
  EXPECT_FALSE(edges.tolerance_m);
  EXPECT_EQ(edges.height_steps.inner_m, 0.5);
  const auto bound =
      std::get<EdgeCollapseOptions>(options(Method::kEdgeCollapse, Stop::kTolerance));
  EXPECT_EQ(bound.least_edges, 0);
  EXPECT_EQ(bound.tolerance_m, 15000);
  const auto points = std::get<PointSetOptions>(options(Method::kPsHierarchy, Stop::kTolerance));
  EXPECT_EQ(points.method, PointSetMethod::kHierarchy);
  EXPECT_EQ(points.cluster_size, 9);
  EXPECT_EQ(points.seed, 5U);
  EXPECT_EQ(std::get<GreedyOptions>(options(Method::kGreedy, Stop::kTolerance)).tolerance_m, 15000);
}

// Small enough for the sanitizers, which leave the methods' own property tests out.
TEST(Simplify, EveryMethodMakesASoundTileWithInheritedBorders) {
  const PostGrid tile = make_tile_grid(TilingScheme(Projection::kMercator), {6, 20, 41});
  const PostGrid plane = make_plane_grid(31, 22, 30, 25);
  for (const Method method : kMethods) {
    SCOPED_TRACE(name_of(method) + ", seed 11");
    std::mt19937_64 random(11);
    const auto heights_m = testing::random_terrain(testing::Terrain::kRidges, random);
    const FixedBorders fixed = testing::random_borders(random, 5);
    const MethodOptions options = method_options(
        method, Stop::kTolerance, values_at(MethodParameters(), method, Stop::kTolerance, 6),
        {.height_steps = 1, .curvature = Curvature::kCounts, .seed = 3});
    const Tin tin = simplify(tile, heights_m, fixed, options);
    EXPECT_EQ(testing::fault_of(tile, tin), "");
    EXPECT_LT(tin.vertices.size(), kTilePostCount / 2);
    for (const Side side : kSides) {
      const auto& mask = fixed[index_of(side)];
      EXPECT_TRUE(!mask || border_of(tin, side) == *mask) << name_of(side);
    }
    const auto small = std::span(heights_m).first(plane.post_count());
    EXPECT_EQ(testing::fault_of(plane, simplify(plane, small, {}, options)), "");
  }
}

class ParameterFile : public ::testing::Test {
 protected:
  std::string written(const std::string& text) {
    const std::filesystem::path path = folder_.path() / "params.json";
    std::ofstream(path) << text;
    return path.string();
  }
  testing::TemporaryFolder folder_;
};

TEST_F(ParameterFile, GivesNumbersListsAndTexts) {
  MethodParameters parameters;
  read_parameter_file(written(R"({
    // what the survey office uses
    "g_e": "8000/2", "e_e": [6000, 2000], "p_m": 5})"),
                      parameters);
  EXPECT_EQ(parameters.of("g_e").at(1), 4000);
  EXPECT_EQ(parameters.of("e_e").at(7), 2000);
  EXPECT_EQ(parameters.of("p_m").at(3), 5);
}

TEST_F(ParameterFile, RefusesWhatItCannotUse) {
  MethodParameters parameters;
  const auto said = [&](const std::string& text) {
    return refusal([&] { read_parameter_file(written(text), parameters); });
  };
  EXPECT_THAT(said("[1]"), HasSubstr("no JSON object"));
  EXPECT_THAT(said("{\"g_e\": 1"), HasSubstr("no JSON object"));
  EXPECT_THAT(said(R"({"g_e": [1, "2"]})"), HasSubstr("\"g_e\" must be"));
  EXPECT_THAT(said(R"({"g_e": []})"), HasSubstr("\"g_e\" must be"));
  EXPECT_THAT(said(R"({"g_e": null})"), HasSubstr("\"g_e\" must be"));
  EXPECT_THAT(said(R"({"tolerance": 3})"), HasSubstr("no parameter of any method"));
  EXPECT_THAT(said(R"({"r_r": 120})"), HasSubstr("params.json: r_r: 120"));
  EXPECT_THROW(read_parameter_file("/nowhere/params.json", parameters), IoError);
}

}  // namespace
}  // namespace qmpipe::method_test
