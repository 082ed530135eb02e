// The evaluation of methods: its numbers are those of the builds, and its page holds them all.
#include "pipeline/compare/compare.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "pipeline/compare/compare_page.h"
#include "pipeline/compare/compare_tables.h"
#include "tests/support/build_fixture.h"

namespace qmpipe::compare_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

class CompareTest : public testing::BuildTest {
 protected:
  Comparison compare(const testing::RasterFixture& raster,
                     const std::vector<std::string>& methods) {
    CompareOptions options;
    options.build = options_for({write(raster)}, "unused");
    options.build.run.checkpoint_s = 0;
    for (const std::string& name : methods) {
      options.methods.push_back(compared_choice_named(name).value());
    }
    options.folder = folder_.path() / "tiles";
    Progress progress(ProgressStyle::kSilent, nullptr);
    return compare_methods(options, progress);
  }

  static testing::RasterFixture without_voids() {
    testing::RasterFixture raster = testing::hilly_raster(8, 11.3, 47.7, 0.01);
    raster.width = 420;
    raster.height = 400;
    raster.value = [hills = raster.value](int c, int r) { return std::max(hills(c, r), 0.0); };
    return raster;
  }
};

TEST_F(CompareTest, NumbersAreThoseOfTheBuildsAndOfTheirVerification) {
  const Comparison comparison = compare(without_voids(), {"greedy", "ps-hierarchy", "ps-grid"});
  ASSERT_EQ(comparison.methods.size(), 3U);
  ASSERT_TRUE(comparison.tile.has_value());
  for (const ComparedMethod& method : comparison.methods) {
    SCOPED_TRACE(name_of(method.choice));
    EXPECT_EQ(method.verify.fault_count, 0);
    const auto zooms = zooms_of(method);
    ASSERT_EQ(zooms.size(), method.build.zooms.size());
    const ComparedZoom& deepest = zooms.back();
    EXPECT_GT(deepest.full_tiles, 0);
    EXPECT_LE(deepest.full_tiles, deepest.tiles);
    EXPECT_EQ(std::ssize(deepest.sorted_hausdorff_m), deepest.full_tiles);
    EXPECT_TRUE(
        std::is_sorted(deepest.sorted_hausdorff_m.begin(), deepest.sorted_hausdorff_m.end()));
    EXPECT_GE(deepest.hausdorff_m, deepest.sorted_hausdorff_m.front());
    EXPECT_LE(deepest.hausdorff_m, deepest.sorted_hausdorff_m.back());
    EXPECT_DOUBLE_EQ(deepest.largest_error_m, method.build.zooms.back().error.largest_m);
    // A disk of triangles: T < 2 V.
    EXPECT_GT(deepest.mean_triangles, deepest.mean_vertices);
    EXPECT_LT(deepest.mean_triangles, 2 * deepest.mean_vertices);
    ASSERT_TRUE(method.trial.has_value());
    EXPECT_GT(method.trial->seconds, 0);
    EXPECT_GT(method.trial->hausdorff.to_surfaces_m, 0);
    EXPECT_LE(method.trial->hausdorff.to_surfaces_m, method.trial->error.largest_m * 1.5 + 50);
  }
  EXPECT_LE(comparison.methods[0].trial->error.largest_m,
            comparison.methods[0].trial->parameters.at("g_e"));
}

TEST_F(CompareTest, ReportsHoldEveryMethodAndZoom) {
  const Comparison comparison = compare(without_voids(), {"greedy", "ps-random"});
  const auto json = nlohmann::json::parse(comparison_json(comparison));
  ASSERT_EQ(json.at("methods").size(), 2U);
  const std::string page = comparison_page(comparison);
  for (const char* part :
       {"<!DOCTYPE html>", "greedy", "ps-random", "r_r = 75", "<svg", "</html>"}) {
    EXPECT_THAT(page, HasSubstr(part));
  }
  // One file: nothing is fetched, nothing runs.
  for (const char* part : {"<script", "http", "src="}) EXPECT_THAT(page, Not(HasSubstr(part)));
  const auto lines = [](const std::string& csv) {
    return std::count(csv.begin(), csv.end(), '\n');
  };
  const auto zooms = std::ssize(zooms_of(comparison.methods[0]));
  EXPECT_EQ(lines(zooms_csv(comparison)), 1 + 2 * zooms);
  EXPECT_EQ(lines(single_tile_csv(comparison)), 3);
  EXPECT_EQ(lines(run_times_csv(comparison)), 3);
  std::int64_t full = 0;
  for (const ComparedZoom& zoom : zooms_of(comparison.methods[0])) full += zoom.full_tiles;
  EXPECT_EQ(lines(distances_csv(comparison)), 1 + 2 * full);
}

TEST_F(CompareTest, InputWithoutAFullTileIsReportedWithoutDistances) {
  const Comparison comparison = compare(testing::hilly_raster(9, 11.3, 47.7, 0.01), {"greedy"});
  EXPECT_FALSE(comparison.tile.has_value());
  EXPECT_FALSE(comparison.methods[0].trial.has_value());
  EXPECT_THAT(comparison_page(comparison), HasSubstr("No zoom has a tile without voids"));
}

TEST(ComparedChoice, NamesReadBack) {
  for (const char* name : {"greedy", "edge-collapse:edges", "edge-collapse:tolerance", "ps-wlop"}) {
    EXPECT_EQ(name_of(compared_choice_named(name).value()), name);
  }
  EXPECT_EQ(name_of(compared_choice_named("edge-collapse").value()), "edge-collapse:tolerance");
  for (const char* name : {"", "greedy:edges", "edge-collapse:", "edge-collapse:x", "wlop"}) {
    EXPECT_FALSE(compared_choice_named(name)) << name;
  }
}

}  // namespace
}  // namespace qmpipe::compare_test
