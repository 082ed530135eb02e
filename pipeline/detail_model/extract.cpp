#include "pipeline/detail_model/extract.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "scheduler/check.h"
#include "scheduler/elementary.h"
#include "stages/detail_model/block.h"

namespace qmpipe {

double svo_at_distance_m(double distance_m, const DetailView& view) {
  const auto [sine, cosine] = sin_cos_deg(view.fov_deg / 2);
  return view.pixels * 2 * distance_m * (sine / cosine) / view.screen_height;
}

namespace {

// The values fall from the coarsest level to the finest.
std::size_t level_for_svo(const DetailBlock& block, double svo_m) {
  const auto first = std::partition_point(block.svo_m.begin(), block.svo_m.end(),
                                          [svo_m](float svo) { return svo > svo_m; });
  const auto level = static_cast<std::size_t>(first - block.svo_m.begin());
  return std::min(level, block.levels());
}

}  // namespace

DetailLevels levels_for_svo(const DetailModel& model, double svo_m) {
  DetailLevels levels;
  for (const DetailBlock& block : model.blocks) levels.push_back(level_for_svo(block, svo_m));
  return levels;
}

DetailLevels levels_for_triangles(const DetailModel& model, std::int64_t most) {
  std::vector<float> thresholds;
  for (const DetailBlock& block : model.blocks) {
    thresholds.insert(thresholds.end(), block.svo_m.begin(), block.svo_m.end());
  }
  std::sort(thresholds.begin(), thresholds.end());
  const auto enough = std::partition_point(thresholds.begin(), thresholds.end(), [&](float svo) {
    return triangles_of(model, levels_for_svo(model, svo)) > most;
  });
  return enough == thresholds.end() ? levels_at(model, 0) : levels_for_svo(model, *enough);
}

DetailLevels levels_at(const DetailModel& model, std::size_t level) {
  DetailLevels levels;
  for (const DetailBlock& block : model.blocks) levels.push_back(std::min(level, block.levels()));
  return levels;
}

double distance_to_block_m(const DetailModel& model, std::size_t block,
                           const std::array<double, 3>& eye_m) {
  const std::vector<DetailPoint>& points = model.blocks[block].points;
  if (points.empty()) return 0;
  std::array<double, 3> low = model.frame.place(points.front());
  std::array<double, 3> high = low;
  for (const DetailPoint& point : points) {
    const std::array<double, 3> place = model.frame.place(point);
    for (std::size_t k = 0; k < 3; ++k) {
      low[k] = std::min(low[k], place[k]);
      high[k] = std::max(high[k], place[k]);
    }
  }
  double squared = 0;
  for (std::size_t k = 0; k < 3; ++k) {
    const double along = (low[k] + high[k]) / 2 - eye_m[k];
    squared += along * along;
  }
  return std::sqrt(squared);
}

DetailLevels levels_from_eye(const DetailModel& model, const std::array<double, 3>& eye_m,
                             const DetailView& view) {
  DetailLevels levels;
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    const double distance_m = distance_to_block_m(model, b, eye_m);
    levels.push_back(level_for_svo(model.blocks[b], svo_at_distance_m(distance_m, view)));
  }
  return levels;
}

std::int64_t triangles_of(const DetailModel& model, const DetailLevels& levels) {
  QMPIPE_CHECK(levels.size() == model.blocks.size());
  std::size_t count = model.seams.size();
  for (std::size_t b = 0; b < levels.size(); ++b) count += model.blocks[b].triangles_at(levels[b]);
  return static_cast<std::int64_t>(count);
}

Result<ExportMesh> extract_mesh(const DetailModel& model, const DetailLevels& levels) {
  QMPIPE_CHECK(levels.size() == model.blocks.size());
  ExportMesh mesh;
  std::vector<std::uint32_t> first;  // of each block's points in the mesh
  for (std::size_t b = 0; b < levels.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    first.push_back(static_cast<std::uint32_t>(mesh.positions_m.size()));
    auto walk = DetailWalk::start(block);
    if (!walk) return Error{fmt::format("block {}: {}", b, walk.error().message)};
    if (const auto error = walk->go_to(levels[b])) {
      return Error{fmt::format("block {}: {}", b, error->message)};
    }
    for (std::size_t k = 0; k < block.points_at(levels[b]); ++k) {
      mesh.positions_m.push_back(model.frame.place(block.points[k]));
    }
    for (const std::uint32_t vertex : walk->triangles()) mesh.indices.push_back(first[b] + vertex);
  }
  for (const DetailSeam& seam : model.seams) {
    for (const DetailCorner& corner : seam) {
      mesh.indices.push_back(first[corner.block] + corner.point);
    }
  }
  return mesh;
}

}  // namespace qmpipe
