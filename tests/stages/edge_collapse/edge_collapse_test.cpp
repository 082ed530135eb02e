#include "stages/edge_collapse/edge_collapse.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>

#include "stages/edge_collapse/collapse_surface.h"
#include "stages/finish/quantize.h"
#include "stages/finish/tile_error.h"
#include "stages/posts/height_step.h"
#include "stages/surface/base_tin.h"
#include "tests/support/terrain_fixture.h"

namespace qmpipe::edge_collapse_test {
namespace {

constexpr double kAnyDepth = std::numeric_limits<double>::infinity();

using namespace testing;  // NOLINT(google-build-using-namespace): the fixture, in a test

using Index = CollapseMesh::Index;

const TilingScheme kGeodetic(Projection::kGeodetic);
const TilingScheme kMercator(Projection::kMercator);

EdgeCollapseOptions options_for(const std::vector<float>& heights_m, double tolerance_m,
                                Curvature curvature) {
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  const auto step_m = height_step_for(tolerance_m, static_cast<double>(*high - *low) + tolerance_m,
                                      std::max(std::abs(*low), std::abs(*high)) + tolerance_m);
  return {.height_steps = step_m.value(), .tolerance_m = tolerance_m, .curvature = curvature};
}

void expect_right(const PostGrid& grid, const std::vector<float>& heights_m,
                  const FixedBorders& fixed, const EdgeCollapseOptions& options) {
  const Tin tin = edge_collapse(grid, heights_m, fixed, options);
  ASSERT_EQ(fault_of(grid, tin), "");
  for (const Side side : kSides) {
    if (fixed[index_of(side)]) {
      ASSERT_EQ(border_of(tin, side), *fixed[index_of(side)]) << name_of(side);
    }
  }
  const auto [low, high] = std::minmax_element(heights_m.begin(), heights_m.end());
  for (const TinVertex& vertex : tin.vertices) {
    ASSERT_EQ(std::remainder(vertex.height_m, options.height_steps.inner_m), 0);
    ASSERT_GE(vertex.height_m, static_cast<double>(*low) - options.height_steps.inner_m / 2);
    ASSERT_LE(vertex.height_m, static_cast<double>(*high) + options.height_steps.inner_m / 2);
    if (vertex.post == kNoPost) continue;
    const auto height_m = static_cast<double>(heights_m[static_cast<std::size_t>(vertex.post)]);
    ASSERT_LE(std::abs(vertex.height_m - height_m), options.height_steps.inner_m / 2);
  }
  if (!options.tolerance_m) return;
  ASSERT_LE(largest_error_m(grid, tin, heights_m, fixed), *options.tolerance_m);
  // The same from what the file holds; posts of fixed sides are for their owner to answer for.
  std::vector<std::uint8_t> judged(kTilePostCount, 1);
  for (const Side side : kSides) {
    for (std::int32_t k = 0; fixed[index_of(side)] && k < kTilePosts; ++k) {
      const Post p = side_post(side, k);
      judged[static_cast<std::size_t>(tile_post_index(p.i, p.j))] = 0;
    }
  }
  const QuantizedMesh mesh = quantize(grid, tin, options.height_steps);
  ASSERT_LE(measure_error(grid, mesh, heights_m, judged).largest_m, *options.tolerance_m);
}

class EdgeCollapseOnTerrain : public ::testing::TestWithParam<Terrain> {};

TEST_P(EdgeCollapseOnTerrain, KeepsEveryPostWithinToleranceAndFixedSidesExactly) {
  for (unsigned sides = 0; sides < 16; ++sides) {
    const std::uint64_t seed = sides + 300;
    SCOPED_TRACE(std::string(name_of(GetParam())) + ", seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto heights_m = random_terrain(GetParam(), random);
    const FixedBorders fixed = random_borders(random, sides);
    constexpr std::array kTolerances = {1.0, 4.0, 30.0, 200.0};
    // A tile of zoom 9 counts curvature for the small tolerances only.
    const PostGrid grid = make_tile_grid(kGeodetic, {9, 300, 411});
    expect_right(grid, heights_m, fixed,
                 options_for(heights_m, kTolerances[sides % 4], Curvature::kCounts));
  }
}

TEST_P(EdgeCollapseOnTerrain, HoldsItsPromisesInTheMercatorSchemeToo) {
  for (std::int32_t zoom = 0; zoom <= 3; ++zoom) {
    const std::uint64_t seed = 11 + static_cast<std::uint64_t>(zoom);
    SCOPED_TRACE(std::string(name_of(GetParam())) + ", seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto heights_m = random_terrain(GetParam(), random);
    const auto rows = static_cast<std::uint64_t>(kMercator.rows(zoom));
    const TileKey key = {zoom, 0, static_cast<std::int32_t>(random() % rows)};
    const FixedBorders fixed = random_borders(random, static_cast<unsigned>(random() % 16));
    expect_right(
        make_tile_grid(kMercator, key), heights_m, fixed,
        options_for(heights_m, 50, zoom % 2 == 0 ? Curvature::kIgnored : Curvature::kCounts));
  }
}

TEST_P(EdgeCollapseOnTerrain, StopsAtTheFirstNumberOfEdgesBelowTheOneAsked) {
  std::mt19937_64 random(23);
  const auto heights_m = random_terrain(GetParam(), random);
  const PostGrid grid = make_tile_grid(kGeodetic, {9, 300, 411});
  for (const std::int64_t least_edges : {100'000, 1'000}) {
    const EdgeCollapseOptions options = {.height_steps = 0.25, .least_edges = least_edges};
    const Tin tin = edge_collapse(grid, heights_m, {}, options);
    ASSERT_EQ(fault_of(grid, tin), "");
    // Euler: a collapse takes two edges or three.
    const auto edges = static_cast<std::int64_t>(tin.vertices.size() + tin.triangle_count()) - 1;
    EXPECT_LT(edges, least_edges);
    EXPECT_GE(edges, least_edges - 3);
    // The same bits each time.
    const Tin again = edge_collapse(grid, heights_m, {}, options);
    EXPECT_EQ(tin.vertices, again.vertices);
    EXPECT_EQ(tin.indices, again.indices);
  }
}

INSTANTIATE_TEST_SUITE_P(All, EdgeCollapseOnTerrain, ::testing::ValuesIn(kTerrains),
                         [](const auto& terrain) {
                           std::string name = name_of(terrain.param);
                           name.erase(std::remove(name.begin(), name.end(), ' '), name.end());
                           return name;
                         });

TEST(EdgeCollapse, AFlatGridOfAnySizeIsTwoTriangles) {
  for (const auto& [width, height] :
       {std::pair{2, 2}, {2, 9}, {9, 2}, {3, 3}, {300, 4}, {40, 40}}) {
    SCOPED_TRACE(std::to_string(width) + " x " + std::to_string(height));
    const PostGrid grid = make_plane_grid(width, height, 10, 20);
    const std::vector<float> heights_m(grid.post_count(), 3.0F);
    for (const auto& tolerance_m : {std::optional<double>(), std::optional(0.5)}) {
      const Tin tin =
          edge_collapse(grid, heights_m, {}, {.height_steps = 0.5, .tolerance_m = tolerance_m});
      EXPECT_EQ(fault_of(grid, tin), "");
      EXPECT_EQ(tin.triangle_count(), 2U);
    }
  }
}

TEST(EdgeCollapse, AnInclinedPlaneIsTwoTrianglesWithItsFourCorners) {
  const PostGrid grid = make_tile_grid(kGeodetic, {14, 9000, 5000});
  std::vector<float> heights_m;
  for (std::size_t k = 0; k < kTilePostCount; ++k) {
    heights_m.push_back(static_cast<float>(k % 257) * 2 + static_cast<float>(k / 257));
  }
  const Tin tin = edge_collapse(grid, heights_m, {}, options_for(heights_m, 1, Curvature::kCounts));
  EXPECT_EQ(tin.triangle_count(), 2U);
}

TEST(EdgeCollapse, NeedsFewerTrianglesThanGreedyInsertionAtTheSameTolerance) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    std::mt19937_64 random(seed);
    const auto heights_m = random_terrain(Terrain::kRidges, random);
    const PostGrid grid = make_tile_grid(kGeodetic, {11, 1200, 800});
    const EdgeCollapseOptions options = options_for(heights_m, 10, Curvature::kCounts);
    const Tin tin = edge_collapse(grid, heights_m, {}, options);
    const Tin greedy = greedy_insertion(
        grid, heights_m, {},
        {.tolerance_m = *options.tolerance_m, .height_steps = options.height_steps});
    EXPECT_LT(tin.triangle_count(), greedy.triangle_count());
  }
}

// The rules of section 4.2, one by one: on 4 x 4 posts of rough terrain, with and without fixed
// sides' flags.
class CollapseRules : public ::testing::Test {
 protected:
  static constexpr std::int32_t kPosts = 4;

  explicit CollapseRules(FixedBorders fixed = {}) {
    std::mt19937_64 random(5);
    for (std::size_t k = 0; k < grid_.post_count(); ++k) {
      heights_m_.push_back(static_cast<float>(random() % 50));
    }
    tin_ = base_tin(grid_, heights_m_, {}, 1);
    surface_.emplace(grid_, tin_, fixed, 1, kAnyDepth, CollapseWeights{});
  }

  Index half_edge(std::int32_t from, std::int32_t to) const {
    for (Index e = 0; e < surface_->mesh().half_edge_count(); ++e) {
      if (surface_->mesh().origin(e) == from && surface_->mesh().target(e) == to) return e;
    }
    return CollapseMesh::kNone;
  }
  bool is_border(std::int32_t post) const {
    const std::int32_t i = grid_.column(post);
    const std::int32_t j = grid_.row(post);
    return i == 0 || j == 0 || i == kPosts - 1 || j == kPosts - 1;
  }
  bool is_corner(std::int32_t post) const {
    const std::int32_t i = grid_.column(post);
    const std::int32_t j = grid_.row(post);
    return (i == 0 || i == kPosts - 1) && (j == 0 || j == kPosts - 1);
  }

  PostGrid grid_ = make_plane_grid(kPosts, kPosts, 10, 10);
  std::vector<float> heights_m_;
  Tin tin_;
  std::optional<CollapseSurface> surface_;
};

TEST_F(CollapseRules, EveryEdgeBecomesWhatItsEndsAllow) {
  const CollapseMesh& mesh = surface_->mesh();
  std::set<std::string> met;
  for (Index e = 0; e < mesh.half_edge_count(); ++e) {
    const Index a = mesh.origin(e);
    const Index b = mesh.target(e);
    const auto candidate = surface_->best(e);
    SCOPED_TRACE(std::to_string(a) + " to " + std::to_string(b));
    if (is_border(a) && is_border(b)) {
      EXPECT_EQ(candidate.has_value(), mesh.on_hull(e));
      met.insert(mesh.on_hull(e) ? "side" : "chord");
    }
    if (!candidate) continue;
    if (is_corner(a)) {
      EXPECT_EQ(candidate->kept, a);
      met.insert("corner");
    } else if (is_corner(b)) {
      EXPECT_EQ(candidate->kept, b);
    } else if (is_border(a) && is_border(b)) {
      EXPECT_TRUE(candidate->kept == a || candidate->kept == b);
    } else if (is_border(a) || is_border(b)) {
      EXPECT_EQ(candidate->kept, is_border(a) ? a : b);
      met.insert("one end");
    } else {
      EXPECT_GT(candidate->vertex.u, 0);
      EXPECT_LT(candidate->vertex.u, grid_.u_max());
      met.insert("inside");
    }
    if (candidate->kept != CollapseMesh::kNone) {
      EXPECT_EQ(candidate->vertex, surface_->vertex(candidate->kept));
    }
  }
  EXPECT_EQ(met.size(), 5U);
}

class CollapseRulesWithAFixedSide : public CollapseRules {
 protected:
  static FixedBorders south() {
    FixedBorders fixed;
    fixed[index_of(Side::kSouth)].emplace();
    return fixed;
  }
  CollapseRulesWithAFixedSide() : CollapseRules(south()) {}
};

TEST_F(CollapseRulesWithAFixedSide, ItsEdgesNeverGoAndItsVerticesNeverMove) {
  for (std::int32_t i = 0; i + 1 < kPosts; ++i) {
    EXPECT_FALSE(surface_->best(half_edge(i, i + 1)));
  }
  // From the row above to the side, and on a free side.
  for (std::int32_t i = 1; i + 1 < kPosts; ++i) {
    const auto candidate = surface_->best(half_edge(kPosts + i, i));
    ASSERT_TRUE(candidate);
    EXPECT_EQ(candidate->kept, i);
  }
  EXPECT_TRUE(surface_->best(half_edge(2 * kPosts - 1, 3 * kPosts - 1)));
}

TEST_F(CollapseRules, WallsAndFoldsDoNotFit) {
  // Post 5 is inside: it may go to its neighbours, not across to where the far side is.
  const Index e = half_edge(5, 6);
  ASSERT_NE(e, CollapseMesh::kNone);
  const auto to = [&](std::int32_t u, std::int32_t v) {
    return surface_->fits(
        e, {.vertex = {.u = u, .v = v, .post = kNoPost, .height_m = 0}, .kept = kNoPost});
  };
  const std::int32_t third = grid_.u[1];
  EXPECT_TRUE(to(third + third / 2, third));
  // In line with the posts above: triangles without area, which lifted would be walls.
  EXPECT_FALSE(to(third + third / 2, 2 * third));
  EXPECT_FALSE(to(third + third / 2, grid_.v_max() - 1));
  EXPECT_FALSE(to(0, third));
}

TEST_F(CollapseRules, AlongAFreeSideTheCheaperEndStays) {
  // The south side is flat but for post 2, which the surface would miss most.
  for (const std::int32_t post : {0, 1, 3}) heights_m_[static_cast<std::size_t>(post)] = 0;
  heights_m_[2] = 50;
  for (const std::size_t post : {4U, 5U, 6U, 7U}) heights_m_[post] = 0;
  surface_.emplace(grid_, base_tin(grid_, heights_m_, {}, 1), FixedBorders{}, 1, kAnyDepth,
                   CollapseWeights{});
  const auto candidate = surface_->best(half_edge(1, 2));
  ASSERT_TRUE(candidate);
  EXPECT_EQ(candidate->kept, 2);
}

TEST_F(CollapseRules, EqualEndsOfASideLeaveTheLowerPost) {
  heights_m_.assign(grid_.post_count(), 7.0F);
  surface_.emplace(grid_, base_tin(grid_, heights_m_, {}, 1), FixedBorders{}, 1, kAnyDepth,
                   CollapseWeights{.volume = 1, .boundary = 1, .shape = 0});
  EXPECT_EQ(surface_->best(half_edge(1, 2))->kept, 1);
  EXPECT_EQ(surface_->best(half_edge(14, 13))->kept, 13);
}

TEST(EdgeCollapse, ASingleSpikeStaysWhereTheToleranceAsksForIt) {
  const PostGrid grid = make_tile_grid(kGeodetic, {14, 9000, 5000});
  std::vector<float> heights_m(kTilePostCount, 0.0F);
  heights_m[static_cast<std::size_t>(tile_post_index(100, 50))] = 100;
  const Tin sharp =
      edge_collapse(grid, heights_m, {}, options_for(heights_m, 5, Curvature::kIgnored));
  EXPECT_LE(largest_error_m(grid, sharp, heights_m, {}), 5);
  EXPECT_GT(sharp.triangle_count(), 4U);
  const Tin blunt =
      edge_collapse(grid, heights_m, {}, options_for(heights_m, 120, Curvature::kIgnored));
  EXPECT_EQ(blunt.triangle_count(), 2U);
}

}  // namespace
}  // namespace qmpipe::edge_collapse_test
