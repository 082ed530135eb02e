#include "pipeline/detail_model/build.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <map>
#include <random>
#include <string>

#include "formats/bytes/errors.h"
#include "pipeline/detail_model/extract.h"
#include "pipeline/detail_model/verify.h"
#include "tests/support/raster_fixture.h"

namespace qmpipe::model_test {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;

// Hills with voids on a grid of 61 x 47 posts.
DetailBase hilly_base(std::int32_t blocks) {
  constexpr std::int32_t kColumns = 61;
  constexpr std::int32_t kRows = 47;
  std::vector<std::int32_t> z;
  std::vector<std::uint8_t> valid;
  std::mt19937 dice(3);
  for (std::int32_t j = 0; j < kRows; ++j) {
    for (std::int32_t i = 0; i < kColumns; ++i) {
      z.push_back(static_cast<std::int32_t>(300 * std::sin(0.21 * i) * std::cos(0.13 * j)) +
                  static_cast<std::int32_t>(dice() % 7));
      valid.push_back(dice() % 50 == 0 ? 0 : 1);
    }
  }
  return grid_base({.columns = kColumns, .rows = kRows, .z = z, .valid = valid},
                   block_grid_of(blocks));
}

DetailModel hilly_model(std::int32_t blocks = 4, std::int32_t threads = 1, double keep = 0.2) {
  Progress progress(ProgressStyle::kSilent, nullptr);
  DetailBuildReport report;
  const DetailBuildOptions options = {
      .input = "", .keep_share = keep, .blocks = blocks, .interval = 10, .threads = threads};
  const DetailFrame frame = {.offset = {5e5, 4e6, 0}, .step_m = {30, 30, 0.1}};
  return simplify_base(hilly_base(blocks), frame, options, progress, report);
}

std::vector<std::string> faults_of(const DetailModel& model) {
  Progress progress(ProgressStyle::kSilent, nullptr);
  return verify_detail(model, 2, progress).faults;
}

TEST(DetailModel, IsTheSameOnAnyNumberOfThreadsAndVerifiesClean) {
  for (const std::int32_t blocks : {1, 4, 15}) {
    SCOPED_TRACE(blocks);
    const DetailModel model = hilly_model(blocks, 1);
    EXPECT_EQ(model, hilly_model(blocks, 4));
    EXPECT_THAT(faults_of(model), IsEmpty());
    EXPECT_GT(model.blocks[0].levels(), 50U);
  }
}

TEST(DetailModel, KeepsTheShareOfTrianglesThatItIsTold) {
  for (const double keep : {0.2, 0.5, 1.0}) {
    const DetailModel model = hilly_model(1, 1, keep);
    const DetailBlock& block = model.blocks[0];
    const auto finest = static_cast<double>(block.triangles_at(block.levels()));
    EXPECT_LE(std::abs(static_cast<double>(block.triangles_at(0)) - keep * finest), 2);
  }
}

TEST(DetailModel, EveryChoiceOfLevelsIsOneSurface) {
  const DetailModel model = hilly_model(6);
  std::mt19937 dice(4);
  const ExportMesh finest = *extract_mesh(model, levels_at(model, 1U << 30U));
  const auto area_of = [](const ExportMesh& mesh) {
    double area = 0;
    for (std::size_t k = 0; k < mesh.indices.size(); k += 3) {
      const Vec3& a = mesh.positions_m[mesh.indices[k]];
      const Vec3& b = mesh.positions_m[mesh.indices[k + 1]];
      const Vec3& c = mesh.positions_m[mesh.indices[k + 2]];
      area += (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    }
    return area;
  };
  // Edges with one triangle only, by place.
  const auto rim_of = [](const ExportMesh& mesh) {
    std::map<std::pair<Vec3, Vec3>, int> edges;
    for (std::size_t k = 0; k < mesh.indices.size(); ++k) {
      const Vec3& from = mesh.positions_m[mesh.indices[k]];
      const Vec3& to = mesh.positions_m[mesh.indices[k % 3 == 2 ? k - 2 : k + 1]];
      ++edges[{from, to}];
      --edges[{to, from}];
    }
    std::erase_if(edges, [](const auto& edge) { return edge.second == 0; });
    return edges;
  };
  for (int round = 0; round < 20; ++round) {
    DetailLevels levels;
    for (const DetailBlock& block : model.blocks) levels.push_back(dice() % (block.levels() + 1));
    const auto mesh = extract_mesh(model, levels);
    ASSERT_TRUE(mesh.ok());
    EXPECT_EQ(static_cast<std::int64_t>(mesh->indices.size() / 3), triangles_of(model, levels));
    EXPECT_NEAR(area_of(*mesh), area_of(finest), 1e-3);
    EXPECT_EQ(rim_of(*mesh), rim_of(finest));
  }
}

TEST(DetailModel, LevelsFollowTheThresholdTheTrianglesAndTheEye) {
  const DetailModel model = hilly_model();
  std::int64_t last = triangles_of(model, levels_for_svo(model, 0));
  EXPECT_EQ(last, triangles_of(model, levels_at(model, 1U << 30U)));
  for (double svo_m = 0.01; svo_m < 1e4; svo_m *= 2) {
    const DetailLevels levels = levels_for_svo(model, svo_m);
    const std::int64_t triangles = triangles_of(model, levels);
    EXPECT_LE(triangles, last);
    last = triangles;
    for (std::size_t b = 0; b < levels.size(); ++b) {
      const DetailBlock& block = model.blocks[b];
      EXPECT_TRUE(block.svo_m[levels[b]] <= svo_m || levels[b] == block.levels());
      EXPECT_TRUE(levels[b] == 0 || block.svo_m[levels[b] - 1] > svo_m);
    }
  }
  EXPECT_EQ(last, triangles_of(model, levels_at(model, 0)));
  for (const std::int64_t most : {1, 2000, 3000, 4000, 1000000}) {
    const DetailLevels levels = levels_for_triangles(model, most);
    EXPECT_TRUE(triangles_of(model, levels) <= most || levels == levels_at(model, 0));
  }
  // From above the first block it is finer than the others.
  const Vec3 above = {5e5 + 15 * 30, 4e6 + 11 * 30, 800};
  const DetailLevels near = levels_from_eye(model, above, {});
  EXPECT_LT(distance_to_block_m(model, 0, above), distance_to_block_m(model, 3, above));
  EXPECT_EQ(near[0],
            levels_for_svo(model, svo_at_distance_m(distance_to_block_m(model, 0, above), {}))[0]);
  // 60 degrees and 1000 pixels: at 1000 m two pixels are 2 * 2 * 1000 * tan(30 degrees) / 1000.
  EXPECT_NEAR(svo_at_distance_m(1000, {.fov_deg = 60, .screen_height = 1000, .pixels = 2}), 2.3094,
              1e-4);
}

TEST(DetailModel, ADemKeepsItsPlaceItsHeightsAndItsVoids) {
  const testing::TemporaryFolder folder;
  const std::string path = testing::file_in(folder, "dem.tif");
  const auto height = [](int c, int r) { return c == 4 && r == 5 ? -99 : 10.125 * r + c * c; };
  testing::write_raster(path, {.width = 20,
                               .height = 16,
                               .geotransform = {{400000, 25, 0, 5000000, 0, -20}},
                               .crs = "EPSG:32632",
                               .void_value = -99,
                               .value = height});
  Progress progress(ProgressStyle::kSilent, nullptr);
  const DetailBuilt built = build_detail({.input = path, .height_step_m = 0.125}, progress);
  EXPECT_THAT(faults_of(built.model), IsEmpty());
  EXPECT_EQ(built.report.points, 20 * 16 - 1);
  EXPECT_EQ(built.report.left_out, 1);
  const auto mesh = extract_mesh(built.model, levels_at(built.model, 1U << 30U));
  ASSERT_TRUE(mesh.ok());
  // Of the four cells around the void one half is left each.
  EXPECT_EQ(mesh->indices.size() / 3, 2U * 19 * 15 - 4);
  for (const Vec3& p : mesh->positions_m) {
    const double c = (p[0] - 400000) / 25 - 0.5;
    const double r = (5000000 - p[1]) / 20 - 0.5;
    EXPECT_NEAR(p[2], height(static_cast<int>(std::lround(c)), static_cast<int>(std::lround(r))),
                1e-9);
  }
}

TEST(DetailModel, RefusesOptionsThatMakeNoSenseAndInputsWithoutASurface) {
  const testing::TemporaryFolder folder;
  const std::string path = testing::file_in(folder, "dem.tif");
  testing::write_raster(path, {.void_value = 0, .value = [](int, int) { return 0; }});
  Progress progress(ProgressStyle::kSilent, nullptr);
  EXPECT_THROW(build_detail({.input = path}, progress), IoError);
  EXPECT_THROW(build_detail({.input = path, .keep_share = 0}, progress), UsageError);
  EXPECT_THROW(build_detail({.input = path, .keep_share = 1.5}, progress), UsageError);
  EXPECT_THROW(build_detail({.input = path, .blocks = 0}, progress), UsageError);
  EXPECT_THROW(build_detail({.input = path, .interval = 0}, progress), UsageError);
  EXPECT_THROW(build_detail({.input = path, .height_step_m = -1}, progress), UsageError);
}

TEST(DetailVerify, FindsEachKindOfDamage) {
  const DetailModel sound = hilly_model();
  const auto fault_after = [&](const std::function<void(DetailModel&)>& damage) {
    DetailModel model = sound;
    damage(model);
    const auto faults = faults_of(model);
    return faults.empty() ? std::string("none") : faults.front();
  };
  EXPECT_THAT(
      fault_after([](DetailModel& m) { std::swap(m.blocks[1].svo_m[3], m.blocks[1].svo_m[40]); }),
      HasSubstr("block 1: the threshold rises"));
  EXPECT_THAT(fault_after([](DetailModel& m) { m.blocks[0].svo_m[0] = std::nanf(""); }),
              HasSubstr("block 0: the threshold of level 0 is"));
  EXPECT_THAT(fault_after([](DetailModel& m) { m.blocks[2].svo_m.pop_back(); }),
              HasSubstr("a threshold for each level"));
  EXPECT_THAT(fault_after([](DetailModel& m) {
                std::swap(m.blocks[0].coarse_triangles[0], m.blocks[0].coarse_triangles[1]);
              }),
              HasSubstr("block 0"));
  EXPECT_THAT(fault_after([](DetailModel& m) { m.blocks[3].splits[7].half_edge = 4000000; }),
              HasSubstr("block 3: the split to level 8"));
  EXPECT_THAT(fault_after([](DetailModel& m) {
                DetailPoint& p = m.blocks[0].points.back();
                p = {.x = p.x + 9, .y = p.y + 9, .z = p.z};
              }),
              HasSubstr("not counter-clockwise"));
  EXPECT_THAT(fault_after([](DetailModel& m) { std::swap(m.seams[5][0], m.seams[5][1]); }),
              HasSubstr("of the seams is not counter-clockwise"));
  EXPECT_THAT(fault_after([](DetailModel& m) { m.seams.push_back(m.seams[5]); }),
              HasSubstr("same side of the edge"));
}

}  // namespace
}  // namespace qmpipe::model_test
