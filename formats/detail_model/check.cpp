#include "formats/detail_model/check.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>

namespace qmpipe {
namespace {

// Half-edges, points and what stands for none of them are numbered in 32 bits.
constexpr std::uint64_t kLimit = std::numeric_limits<std::uint32_t>::max();

// Each number on its own first, so that no sum overflows.
bool is_numberable(const DetailBlockSize& size) {
  return size.coarse_points < kLimit && size.coarse_triangles < kLimit && size.splits < kLimit &&
         size.coarse_points + size.splits < kLimit &&
         3 * size.coarse_triangles + 6 * size.splits < kLimit;
}

}  // namespace

DetailSummary summary_of(const DetailModel& model) {
  DetailSummary summary = {.frame = model.frame,
                           .crs_wkt = model.crs_wkt,
                           .interval = model.interval,
                           .blocks = {},
                           .seams = model.seams.size()};
  for (const DetailBlock& block : model.blocks) {
    summary.blocks.push_back({.coarse_points = block.coarse_points(),
                              .coarse_triangles = block.coarse_triangles.size() / 3,
                              .splits = block.splits.size()});
  }
  return summary;
}

std::optional<Error> fault_of(const DetailSummary& summary) {
  for (const double offset : summary.frame.offset) {
    if (!std::isfinite(offset)) return Error{"its frame's offset is not finite"};
  }
  for (const double step_m : summary.frame.step_m) {
    if (!std::isfinite(step_m) || step_m <= 0) {
      return Error{fmt::format("its frame has a step of {} m", step_m)};
    }
  }
  if (summary.interval == 0) return Error{"its interval is 0"};
  if (summary.blocks.empty()) return Error{"it has no block"};
  if (summary.blocks.size() >= kLimit || summary.seams >= kLimit) {
    return Error{"it has more blocks or seams than can be numbered"};
  }
  for (std::size_t b = 0; b < summary.blocks.size(); ++b) {
    const DetailBlockSize& size = summary.blocks[b];
    if (is_numberable(size)) continue;
    return Error{
        fmt::format("its block {} has {} coarse points, {} coarse triangles and {} splits, "
                    "more than can be numbered",
                    b, size.coarse_points, size.coarse_triangles, size.splits)};
  }
  return std::nullopt;
}

std::optional<Error> fault_of_topology(const DetailBlock& block) {
  if (block.coarse_triangles.size() % 3 != 0) {
    return Error{"the coarsest mesh has a part of a triangle"};
  }
  for (const std::uint32_t point : block.coarse_triangles) {
    if (point < block.coarse_points()) continue;
    return Error{
        fmt::format("the coarsest mesh names point {} of {}", point, block.coarse_points())};
  }
  for (std::size_t level = 0; level < block.levels(); ++level) {
    const DetailSplit& split = block.splits[level];
    const std::size_t triangles = block.triangles_at(level);
    if (split.half_edge >= 3 * triangles || split.fan < 1 || split.fan > triangles) {
      return Error{fmt::format("split {} names half-edge {} and a fan of {}, of {} triangles",
                               level, split.half_edge, split.fan, triangles)};
    }
  }
  return std::nullopt;
}

std::optional<Error> fault_of_values(const DetailBlock& block) {
  for (std::size_t k = 0; k < block.points.size(); ++k) {
    const DetailPoint& p = block.points[k];
    if (p.x >= 0 && p.x <= kDetailGridMax && p.y >= 0 && p.y <= kDetailGridMax) continue;
    return Error{fmt::format("point {} lies at {}, {}, outside the grid", k, p.x, p.y)};
  }
  if (block.svo_m.size() != block.levels() + 1) {
    return Error{fmt::format("{} smallest visible objects are given for {} levels",
                             block.svo_m.size(), block.levels() + 1)};
  }
  for (std::size_t level = 0; level < block.svo_m.size(); ++level) {
    const float svo_m = block.svo_m[level];
    // -0 as well: its bits would be the largest of all.
    if (!std::isfinite(svo_m) || std::signbit(svo_m) ||
        (level > 0 && svo_m > block.svo_m[level - 1])) {
      return Error{fmt::format("the smallest visible object of level {} is {} m", level, svo_m)};
    }
  }
  return std::nullopt;
}

std::optional<Error> fault_of_seams(const DetailModel& model) {
  for (std::size_t k = 0; k < model.seams.size(); ++k) {
    for (const DetailCorner& corner : model.seams[k]) {
      if (corner.block < model.blocks.size() &&
          corner.point < model.blocks[corner.block].coarse_points()) {
        continue;
      }
      return Error{
          fmt::format("seam {} names point {} of block {}", k, corner.point, corner.block)};
    }
  }
  return std::nullopt;
}

}  // namespace qmpipe
