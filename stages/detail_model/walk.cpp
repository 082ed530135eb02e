#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "scheduler/check.h"
#include "stages/detail_model/block.h"
#include "stages/surface/triangle_edges.h"

namespace qmpipe {

Result<DetailWalk> DetailWalk::start(const DetailBlock& block) {
  DetailWalk walk(block);
  if (block.coarse_triangles.size() % 3 != 0)
    return Error{"the coarsest mesh has a part of a triangle"};
  if (block.points.size() < block.splits.size()) return Error{"there are more splits than points"};
  const std::size_t half_edges = block.coarse_triangles.size() + 6 * block.splits.size();
  if (half_edges >= kNone) return Error{"there are more than 2^32 half-edges"};
  for (const std::uint32_t vertex : block.coarse_triangles) {
    if (vertex < block.coarse_points()) continue;
    return Error{
        fmt::format("the coarsest mesh names point {} of {}", vertex, block.coarse_points())};
  }
  walk.vertices_ = block.coarse_triangles;
  walk.vertices_.reserve(half_edges);
  walk.twins_.reserve(half_edges);
  if (auto error = walk.find_twins()) return std::move(*error);
  return walk;
}

std::optional<Error> DetailWalk::find_twins() {
  for (std::uint32_t e = 0; e < vertices_.size(); ++e) {
    if (vertices_[e] != vertices_[next(e)]) continue;
    return Error{fmt::format("triangle {} has a point twice", e / 3)};
  }
  const std::vector<TriangleEdge> edges = sorted_edges(vertices_);
  twins_.assign(vertices_.size(), kNone);
  for (std::size_t k = 1; k < edges.size(); ++k) {
    if (edges[k].ends != edges[k - 1].ends) continue;
    const std::uint32_t e = edges[k - 1].half_edge;
    const std::uint32_t f = edges[k].half_edge;
    // Three triangles at an edge, or two that lie the same way round.
    if (twins_[e] != kNone || vertices_[e] == vertices_[f]) {
      return Error{fmt::format("the edge from point {} to {} is no manifold's", vertices_[e],
                               vertices_[next(e)])};
    }
    link(e, f);
  }
  return std::nullopt;
}

void DetailWalk::link(std::uint32_t e, std::uint32_t f) {
  if (e != kNone) twins_[e] = f;
  if (f != kNone) twins_[f] = e;
}

Result<DetailWalk::Fan> DetailWalk::fan_of_next_split() const {
  QMPIPE_CHECK(level_ < block_->levels());
  const DetailSplit& split = block_->splits[level_];
  const auto damaged = [&](const char* what) {
    return Error{fmt::format("the split to level {} {}", level_ + 1, what)};
  };
  if (split.half_edge >= vertices_.size()) return damaged("names a triangle that is not there");
  if (split.fan == 0) return damaged("takes no triangle");
  std::uint32_t last = split.half_edge;
  for (std::uint32_t k = 1; k < split.fan; ++k) {
    last = twins_[previous(last)];
    if (last == kNone) return damaged("reaches over the rim");
    if (last == split.half_edge) return damaged("reaches around its point");
  }
  // A point inside keeps a triangle of its own.
  if (twins_[previous(last)] == split.half_edge) return damaged("takes all triangles of its point");
  return Fan{.first = split.half_edge, .last = last};
}

void DetailWalk::split(const Fan& fan) {
  const std::uint32_t end = previous(fan.last);  // from l to v
  const std::uint32_t v = vertices_[fan.first];
  const auto u = static_cast<std::uint32_t>(block_->points_at(level_));
  const std::uint32_t r = vertices_[next(fan.first)];
  const std::uint32_t l = vertices_[end];
  const auto added = static_cast<std::uint32_t>(vertices_.size());
  for (std::uint32_t e = fan.first;; e = twins_[previous(e)]) {
    vertices_[e] = u;
    if (e == fan.last) break;
  }
  vertices_.insert(vertices_.end(), {v, r, u, v, u, l});
  twins_.resize(vertices_.size(), kNone);
  link(added, twins_[fan.first]);
  link(added + 5, twins_[end]);
  link(added + 1, fan.first);
  link(added + 4, end);
  link(added + 2, added + 3);
  ++level_;
}

void DetailWalk::merge() {
  QMPIPE_CHECK(level_ > 0);
  --level_;
  const DetailSplit& split = block_->splits[level_];
  const auto first = static_cast<std::uint32_t>(vertices_.size() - 6);
  const std::uint32_t v = vertices_[first];
  std::uint32_t e = split.half_edge;
  for (std::uint32_t k = 0; k < split.fan; ++k) {
    vertices_[e] = v;
    const std::uint32_t across = twins_[previous(e)];
    if (k + 1 == split.fan) {
      twins_[previous(e)] = kNone;
      link(previous(e), twins_[first + 5]);
    }
    e = across;
  }
  twins_[split.half_edge] = kNone;
  link(split.half_edge, twins_[first]);
  vertices_.resize(first);
  twins_.resize(first);
}

std::optional<Error> DetailWalk::go_to(std::size_t level) {
  QMPIPE_CHECK(level <= block_->levels());
  while (level_ > level) coarsen();
  while (level_ < level) {
    if (auto error = refine()) return error;
  }
  return std::nullopt;
}

}  // namespace qmpipe
