#include <fmt/format.h>

#include <bit>
#include <optional>
#include <span>

#include "formats/detail_model/arrays.h"
#include "formats/detail_model/prediction.h"
#include "scheduler/check.h"

namespace qmpipe {
namespace {

class ArrayDecoder {
 public:
  explicit ArrayDecoder(const DetailArrays& arrays) : arrays_(arrays) {}

  Result<DetailBlock> take_block(const DetailBlockSize& size) {
    DetailBlock block;
    const auto half_edges = take(DetailArray::kHalfEdge, size.splits);
    const auto fans = take(DetailArray::kFan, size.splits);
    block.splits.reserve(size.splits);
    for (std::size_t k = 0; k < size.splits; ++k) {
      block.splits.push_back({.half_edge = half_edges[k], .fan = fans[k]});
    }
    take_corners(size.coarse_triangles, block);
    block.points.resize(size.coarse_points + size.splits);
    // The prediction trusts them.
    if (const auto error = fault_of_topology(block)) return *error;
    take_points(block);
    take_svo(block);
    if (const auto error = fault_of_values(block)) return *error;
    return block;
  }

  std::optional<Error> take_seams(std::uint64_t count, DetailModel& model) {
    std::vector<std::uint32_t> last(model.blocks.size(), 0);
    const auto blocks = take(DetailArray::kSeamBlock, 3 * count);
    const auto points = take(DetailArray::kSeamPoint, 3 * count);
    model.seams.resize(count);
    for (std::size_t k = 0; k < 3 * count; ++k) {
      const std::uint32_t block = blocks[k];
      if (block >= model.blocks.size()) {
        return Error{fmt::format("seam {} names block {} of {}", k / 3, block, last.size())};
      }
      last[block] = undo_zig_zag(points[k], last[block]);
      model.seams[k / 3][k % 3] = {.block = block, .point = last[block]};
    }
    return fault_of_seams(model);
  }

 private:
  // The next values of an array.
  std::span<const std::uint32_t> take(DetailArray array, std::uint64_t count) {
    const std::size_t from = taken_[index_of(array)];
    taken_[index_of(array)] += count;
    return std::span(arrays_[index_of(array)]).subspan(from, count);
  }

  void take_corners(std::uint64_t triangles, DetailBlock& block) {
    block.coarse_triangles.resize(3 * triangles);
    for (std::size_t corner = 0; corner < 3; ++corner) {
      const auto array = static_cast<DetailArray>(index_of(DetailArray::kCornerA) + corner);
      const auto codes = take(array, triangles);
      std::uint32_t last = 0;
      for (std::size_t t = 0; t < triangles; ++t) {
        last = undo_zig_zag(codes[t], last);
        block.coarse_triangles[3 * t + corner] = last;
      }
    }
  }

  void take_points(DetailBlock& block) {
    const std::size_t count = block.points.size();
    const auto x = take(DetailArray::kPointX, count);
    const auto y = take(DetailArray::kPointY, count);
    const auto z = take(DetailArray::kPointZ, count);
    const auto number = [](std::uint32_t code, std::int32_t expected) {
      return static_cast<std::int32_t>(undo_zig_zag(code, static_cast<std::uint32_t>(expected)));
    };
    const auto place = [&](std::size_t k, const DetailPoint& expected) {
      block.points[k] = {.x = number(x[k], expected.x),
                         .y = number(y[k], expected.y),
                         .z = number(z[k], expected.z)};
    };
    for (std::size_t k = 0; k < block.coarse_points(); ++k) {
      place(k, k == 0 ? DetailPoint{} : block.points[k - 1]);
    }
    DetailPrediction prediction(block.coarse_triangles, block.splits.size());
    for (std::size_t level = 0; level < block.levels(); ++level) {
      const std::uint32_t half_edge = block.splits[level].half_edge;
      const std::size_t k = block.points_at(level);
      place(k, prediction.expect(half_edge, block.points));
      prediction.add(half_edge, static_cast<std::uint32_t>(k));
    }
  }

  // A fall by more than there is wraps to larger bits: a number that rises, or none.
  void take_svo(DetailBlock& block) {
    std::uint32_t bits = 0;
    for (const std::uint32_t word : take(DetailArray::kSvo, block.levels() + 1)) {
      bits = block.svo_m.empty() ? word : bits - word;
      block.svo_m.push_back(std::bit_cast<float>(bits));
    }
  }

  const DetailArrays& arrays_;
  std::array<std::size_t, kDetailArrayCount> taken_{};
};

}  // namespace

Result<DetailModel> decode_detail(const DetailSummary& summary, const DetailArrays& arrays) {
  QMPIPE_CHECK(!fault_of(summary));
  const auto lengths = array_lengths(summary);
  for (std::size_t k = 0; k < kDetailArrayCount; ++k) QMPIPE_CHECK(arrays[k].size() == lengths[k]);
  DetailModel model = {.frame = summary.frame,
                       .crs_wkt = summary.crs_wkt,
                       .interval = summary.interval,
                       .blocks = {},
                       .seams = {}};
  ArrayDecoder decoder(arrays);
  for (std::size_t b = 0; b < summary.blocks.size(); ++b) {
    auto block = decoder.take_block(summary.blocks[b]);
    if (!block) return Error{fmt::format("its block {}: {}", b, block.error().message)};
    model.blocks.push_back(std::move(*block));
  }
  if (const auto error = decoder.take_seams(summary.seams, model)) return *error;
  return model;
}

}  // namespace qmpipe
