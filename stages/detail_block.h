// One block of a detail-increment model: the coarsest mesh and what makes it finer, step by step, and
// the walk through all of its levels (Ai et al. 2019, sections 2.2 and 2.3.1).
//
// Level 0 is the coarsest; each level has one vertex and two triangles more than the one before it.
// Points and triangles are numbered in that order: the coarsest mesh's first, then the split's own, so
// that level l has the first coarse_points + l points and the first coarse_triangles + 2 l triangles,
// and an increment need not name what it adds.
//
// A split is the inverse of a collapse. It names the first half-edge of a fan: the vertex v it leaves
// is split, and the new vertex u takes over `fan` triangles around v, counter-clockwise from that one,
// the last one ending at the edge from l to v. Two triangles are added: (v, r, u) and (v, u, l), where
// r is the end of the half-edge. Half-edge 3 t + k leaves the k-th vertex of triangle t.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "formats/result.h"
#include "stages/detail_point.h"
#include "stages/detail_simplify.h"

namespace qmpipe {

struct DetailSplit {
  std::uint32_t half_edge = 0;
  std::uint32_t fan = 0;
  friend bool operator==(const DetailSplit&, const DetailSplit&) = default;
};

struct DetailBlock {
  std::vector<DetailPoint> points;
  std::vector<std::uint32_t> coarse_triangles;  // three points each, counter-clockwise
  std::vector<DetailSplit> splits;
  // Of each level, levels() + 1 values, metres: the smallest visible object, the root of the mean
  // least quadric error, made to fall (not rise) from level to level.
  std::vector<float> svo_m;

  std::size_t levels() const { return splits.size(); }
  std::size_t coarse_points() const { return points.size() - splits.size(); }
  std::size_t points_at(std::size_t level) const { return coarse_points() + level; }
  std::size_t triangles_at(std::size_t level) const {
    return coarse_triangles.size() / 3 + 2 * level;
  }
  friend bool operator==(const DetailBlock&, const DetailBlock&) = default;
};

// A block from a mesh and the record of its simplification; which point became which: `order[k]` is
// the number in `points` of the block's point k. REQUIRES: what simplify_by_quadrics() was given.
struct OrderedBlock {
  DetailBlock block;
  std::vector<std::uint32_t> order;
};
OrderedBlock make_detail_block(std::span<const DetailPoint> points,
                               std::span<const std::uint32_t> triangles,
                               const DetailRecord& record);

// The mesh of a block at a level that can be changed. REQUIRES: the block outlives it.
class DetailWalk {
 public:
  // Starts at level 0. Refuses a block that is damaged in its coarsest mesh; every index is checked.
  static Result<DetailWalk> start(const DetailBlock& block);

  std::size_t level() const { return level_; }
  // Three points for each triangle.
  std::span<const std::uint32_t> triangles() const { return vertices_; }

  // One level finer; tells each triangle that changes, before it does: touched(triangle). An error when the split cannot be: its half-edge is not there, its fan reaches
  // over the surface's rim or around the whole vertex. Then the mesh is as before.
  template <class Touched>
  std::optional<Error> refine(const Touched& touched) {
    auto fan = fan_of_next_split();
    if (!fan) return std::move(fan.error());
    for (std::uint32_t e = fan->first;; e = twins_[previous(e)]) {
      touched(e / 3);
      if (e == fan->last) break;
    }
    split(*fan);
    return std::nullopt;
  }
  std::optional<Error> refine() {
    return refine([](std::uint32_t /*triangle*/) {});
  }
  // One level coarser. REQUIRES: level() > 0.
  void coarsen();
  // REQUIRES: level <= levels.
  std::optional<Error> go_to(std::size_t level);

 private:
  // Half-edges that leave the vertex that is split.
  struct Fan {
    std::uint32_t first;
    std::uint32_t last;
  };
  explicit DetailWalk(const DetailBlock& block) : block_(&block) {}
  Result<Fan> fan_of_next_split() const;
  void split(const Fan& fan);
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;
  static std::uint32_t next(std::uint32_t e) { return e % 3 == 2 ? e - 2 : e + 1; }
  static std::uint32_t previous(std::uint32_t e) { return e % 3 == 0 ? e + 2 : e - 1; }
  std::optional<Error> find_twins();
  void link(std::uint32_t e, std::uint32_t f);

  const DetailBlock* block_;
  std::size_t level_ = 0;
  std::vector<std::uint32_t> vertices_;  // by half-edge: the one it leaves
  std::vector<std::uint32_t> twins_;     // by half-edge
};

}  // namespace qmpipe
