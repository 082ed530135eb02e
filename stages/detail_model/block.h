// The walk through all levels of one block of a detail-increment model (Ai et al. 2019, sections 2.2 and
// 2.3.1), and how a block is made.
#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "formats/bytes/result.h"
#include "formats/detail_model/data.h"
#include "stages/detail_model/simplify.h"

namespace qmpipe {

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
    if (!fan) return fan.error();
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
  // One level coarser; likewise tells each triangle that stays and changes. REQUIRES: level() > 0.
  template <class Touched>
  void coarsen(const Touched& touched) {
    const DetailSplit& split = block_->splits[level_ - 1];
    std::uint32_t e = split.half_edge;
    for (std::uint32_t k = 0; k < split.fan; ++k, e = twins_[previous(e)]) touched(e / 3);
    merge();
  }
  void coarsen() { merge(); }
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
  void merge();
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
