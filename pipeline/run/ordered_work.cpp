#include "pipeline/run/ordered_work.h"

#include <oneapi/tbb/parallel_pipeline.h>
#include <oneapi/tbb/task_arena.h>

#include <atomic>
#include <utility>
#include <vector>

#include "scheduler/check.h"

namespace qmpipe {
namespace {

// Enough that a slow tile holds nobody up.
constexpr std::int32_t kResultsPerThread = 4;

}  // namespace

std::int64_t work_in_order(std::int32_t threads, std::int64_t count,
                           const std::function<InTurn(std::int64_t)>& work,
                           const std::function<bool()>& should_stop) {
  QMPIPE_CHECK(threads >= 1);
  const std::size_t most_at_once = static_cast<std::size_t>(threads) * kResultsPerThread;
  // TBB passes numbers only: of a run that an exception ends it forgets what lies between its filters,
  // and would not free it. No two numbers on the way share a place.
  std::vector<InTurn> results(most_at_once);
  const auto place_of = [&](std::int64_t index) -> InTurn& {
    return results[static_cast<std::size_t>(index) % most_at_once];
  };
  std::int64_t next = 0;
  std::int64_t taken = 0;
  std::atomic<bool> is_ended = false;
  const auto feed = [&](tbb::flow_control& control) -> std::int64_t {
    if (next == count || is_ended || should_stop()) {
      control.stop();
      return 0;
    }
    return next++;
  };
  const auto work_on = [&](std::int64_t index) {
    if (!is_ended) place_of(index) = work(index);
    return index;
  };
  const auto take = [&](std::int64_t index) {
    const InTurn in_turn = std::exchange(place_of(index), {});
    if (is_ended) return;
    if (in_turn()) {
      ++taken;
    } else {
      is_ended = true;
    }
  };
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_pipeline(
        most_at_once,
        tbb::make_filter<void, std::int64_t>(tbb::filter_mode::serial_in_order, feed) &
            tbb::make_filter<std::int64_t, std::int64_t>(tbb::filter_mode::parallel, work_on) &
            tbb::make_filter<std::int64_t, void>(tbb::filter_mode::serial_in_order, take));
  });
  return taken;
}

}  // namespace qmpipe
