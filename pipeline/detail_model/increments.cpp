#include "pipeline/detail_model/increments.h"

#include <fmt/format.h>

#include <algorithm>

#include "stages/detail_model/increment.h"

namespace qmpipe {
namespace {

// Level and MMQE; of a deleted triangle its number and three points, of a replaced one three more.
constexpr std::int64_t kIncrementBytes = 8;
constexpr std::int64_t kDeletedBytes = 16;
constexpr std::int64_t kReplacedBytes = 28;

}  // namespace

Result<IncrementSums> sum_increments(const DetailModel& model) {
  IncrementSums sums;
  for (std::size_t b = 0; b < model.blocks.size(); ++b) {
    const DetailBlock& block = model.blocks[b];
    for (const DetailSplit& split : block.splits) {
      sums.changed_singly += 2 + std::int64_t{split.fan};
      sums.raw_bytes_singly += kIncrementBytes + 2 * kDeletedBytes + kReplacedBytes * split.fan;
    }
    sums.levels += static_cast<std::int64_t>(block.levels());
    auto walk = DetailWalk::start(block);
    if (!walk) return Error{fmt::format("block {}: {}", b, walk.error().message)};
    while (walk->level() < block.levels()) {
      const auto increment =
          increment_to(*walk, std::min(walk->level() + model.interval, block.levels()));
      if (!increment) return Error{fmt::format("block {}: {}", b, increment.error().message)};
      const auto deleted = static_cast<std::int64_t>(increment->deleted.size());
      const auto replaced = static_cast<std::int64_t>(increment->replaced.size());
      ++sums.increments;
      sums.changed_merged += deleted + replaced;
      sums.raw_bytes_merged +=
          kIncrementBytes + kDeletedBytes * deleted + kReplacedBytes * replaced;
    }
  }
  return sums;
}

}  // namespace qmpipe
