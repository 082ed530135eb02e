#include "pipeline/common/svg.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "stages/greedy/greedy.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::svg_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

std::size_t count_of(const std::string& text, const std::string& part) {
  std::size_t count = 0;
  for (auto at = text.find(part); at != std::string::npos; at = text.find(part, at + 1)) ++count;
  return count;
}

Chart chart_of(Scale y_scale, std::vector<std::pair<double, double>> points) {
  return {.title = "a < b",
          .x_label = "x",
          .y_label = "y",
          .y_scale = y_scale,
          .lines = {{.name = "one", .points = std::move(points)}}};
}

TEST(ChartSvg, LinesLieBetweenTheAxesAndRise) {
  const std::string svg = chart_svg(chart_of(Scale::kLinear, {{1, 10}, {2, 20}, {3, 30}}));
  EXPECT_THAT(svg, HasSubstr("a &lt; b"));
  const auto path = svg.find("fill=\"none\"");
  ASSERT_NE(path, std::string::npos);
  const std::string drawn = svg.substr(svg.rfind("d=\"M", path), path - svg.rfind("d=\"M", path));
  double x[3];
  double y[3];
  ASSERT_EQ(std::sscanf(drawn.c_str(), "d=\"M%lf %lfL%lf %lfL%lf %lf", &x[0], &y[0], &x[1], &y[1],
                        &x[2], &y[2]),
            6);
  EXPECT_LT(x[0], x[1]);
  EXPECT_LT(x[1], x[2]);
  // Pixels count downwards.
  EXPECT_GT(y[0], y[1]);
  EXPECT_GT(y[1], y[2]);
  EXPECT_GT(y[2], 28);
}

TEST(ChartSvg, LogarithmicAxesLeaveOutWhatTheyCannotShow) {
  const std::string svg = chart_svg(chart_of(Scale::kLogarithmic, {{1, 0}, {2, 5}, {3, 500}}));
  EXPECT_EQ(count_of(svg, "L"), 1U);  // a line of two points
  for (const char* tick : {">10<", ">100<"}) EXPECT_THAT(svg, HasSubstr(tick));
  EXPECT_THAT(svg, Not(HasSubstr("nan")));
  EXPECT_THAT(svg, Not(HasSubstr("inf")));
  EXPECT_EQ(chart_svg(chart_of(Scale::kLogarithmic, {{1, 0}})), "");
}

TEST(ChartSvg, OnePointAndEqualValuesAreShown) {
  for (const Scale scale : {Scale::kLinear, Scale::kLogarithmic}) {
    const std::string svg = chart_svg(chart_of(scale, {{1, 7}, {2, 7}}));
    EXPECT_NE(svg, "");
    EXPECT_THAT(svg, Not(HasSubstr("nan")));
  }
  EXPECT_NE(chart_svg(chart_of(Scale::kLinear, {{0, 0}})), "");
}

TEST(TileSvg, EveryTriangleIsDrawnOnce) {
  std::mt19937_64 random(4);
  const auto heights_m = testing::random_terrain(testing::Terrain::kHills, random);
  const PostGrid grid = make_tile_grid(TilingScheme(Projection::kGeodetic), {9, 300, 411});
  const Tin tin = greedy_insertion(grid, heights_m, {}, {.tolerance_m = 30, .height_steps = 1});
  EXPECT_EQ(count_of(tin_svg(grid, tin), "z"), tin.triangle_count());
  EXPECT_EQ(count_of(posts_svg(grid, heights_m), "z"), 128U * 128U);
}

// North is up, light comes from the north-west.
TEST(TileSvg, SlopesTowardsTheLightAreBrighter) {
  const PostGrid grid = make_plane_grid(3, 3, 10, 10);
  const auto grey_of = [&](double east_m, double north_m) {
    std::vector<float> heights_m;
    for (std::int32_t j = 0; j < 3; ++j) {
      for (std::int32_t i = 0; i < 3; ++i) {
        heights_m.push_back(static_cast<float>(i * east_m + j * north_m));
      }
    }
    const std::string svg = posts_svg(grid, heights_m);
    return std::stoi(svg.substr(svg.find("fill=\"#") + 7, 2), nullptr, 16);
  };
  const int flat = grey_of(0, 0);
  EXPECT_GT(grey_of(3, 0), flat);  // rises to the east: faces west
  EXPECT_LT(grey_of(-3, 0), flat);
  EXPECT_GT(grey_of(0, -3), flat);  // falls to the north: faces north
  EXPECT_LT(grey_of(0, 3), flat);
}

}  // namespace
}  // namespace qmpipe::svg_test
