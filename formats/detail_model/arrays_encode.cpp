#include <bit>

#include "formats/detail_model/arrays.h"
#include "formats/detail_model/prediction.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

class Encoder {
 public:
  void add_block(const DetailBlock& block) {
    add_points(block);
    std::array<std::uint32_t, 3> last{};
    for (std::size_t k = 0; k < block.coarse_triangles.size(); ++k) {
      const std::uint32_t point = block.coarse_triangles[k];
      arrays_[index_of(DetailArray::kCornerA) + k % 3].push_back(zig_zag(point, last[k % 3]));
      last[k % 3] = point;
    }
    for (const DetailSplit& split : block.splits) {
      of(DetailArray::kHalfEdge).push_back(split.half_edge);
      of(DetailArray::kFan).push_back(split.fan);
    }
    // Of numbers that are not negative, the bits fall as the numbers do.
    std::uint32_t coarser = 0;
    for (std::size_t level = 0; level < block.svo_m.size(); ++level) {
      const auto bits = std::bit_cast<std::uint32_t>(block.svo_m[level]);
      of(DetailArray::kSvo).push_back(level == 0 ? bits : coarser - bits);
      coarser = bits;
    }
  }

  void add_seams(const DetailModel& model) {
    std::vector<std::uint32_t> last(model.blocks.size(), 0);
    for (const DetailSeam& seam : model.seams) {
      for (const DetailCorner& corner : seam) {
        of(DetailArray::kSeamBlock).push_back(corner.block);
        of(DetailArray::kSeamPoint).push_back(zig_zag(corner.point, last[corner.block]));
        last[corner.block] = corner.point;
      }
    }
  }

  DetailArrays take() { return std::move(arrays_); }

 private:
  std::vector<std::uint32_t>& of(DetailArray array) { return arrays_[index_of(array)]; }

  void add_point(const DetailPoint& point, const DetailPoint& expected) {
    const auto word = [](std::int32_t number) { return static_cast<std::uint32_t>(number); };
    of(DetailArray::kPointX).push_back(zig_zag(word(point.x), word(expected.x)));
    of(DetailArray::kPointY).push_back(zig_zag(word(point.y), word(expected.y)));
    of(DetailArray::kPointZ).push_back(zig_zag(word(point.z), word(expected.z)));
  }

  void add_points(const DetailBlock& block) {
    DetailPoint last;
    for (std::size_t k = 0; k < block.coarse_points(); ++k) {
      add_point(block.points[k], last);
      last = block.points[k];
    }
    DetailPrediction prediction(block.coarse_triangles, block.splits.size());
    for (std::size_t level = 0; level < block.levels(); ++level) {
      const std::uint32_t half_edge = block.splits[level].half_edge;
      const std::size_t point = block.points_at(level);
      add_point(block.points[point], prediction.expect(half_edge, block.points));
      prediction.add(half_edge, static_cast<std::uint32_t>(point));
    }
  }

  DetailArrays arrays_;
};

}  // namespace

std::array<std::uint64_t, kDetailArrayCount> array_lengths(const DetailSummary& summary) {
  std::array<std::uint64_t, kDetailArrayCount> lengths{};
  const auto of = [&lengths](DetailArray array) -> std::uint64_t& {
    return lengths[index_of(array)];
  };
  for (const DetailBlockSize& size : summary.blocks) {
    of(DetailArray::kPointX) += size.coarse_points + size.splits;
    of(DetailArray::kCornerA) += size.coarse_triangles;
    of(DetailArray::kHalfEdge) += size.splits;
    of(DetailArray::kSvo) += size.splits + 1;
  }
  of(DetailArray::kPointY) = of(DetailArray::kPointZ) = of(DetailArray::kPointX);
  of(DetailArray::kCornerB) = of(DetailArray::kCornerC) = of(DetailArray::kCornerA);
  of(DetailArray::kFan) = of(DetailArray::kHalfEdge);
  of(DetailArray::kSeamBlock) = of(DetailArray::kSeamPoint) = 3 * summary.seams;
  return lengths;
}

DetailArrays encode_detail(const DetailModel& model) {
  for (const DetailBlock& block : model.blocks) {
    QMPIPE_CHECK(block.points.size() >= block.splits.size());
    QMPIPE_CHECK(!fault_of_topology(block) && !fault_of_values(block));
  }
  QMPIPE_CHECK(!fault_of(summary_of(model)) && !fault_of_seams(model));
  Encoder encoder;
  for (const DetailBlock& block : model.blocks) encoder.add_block(block);
  encoder.add_seams(model);
  return encoder.take();
}

}  // namespace qmpipe
