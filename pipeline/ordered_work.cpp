#include "pipeline/ordered_work.h"

#include <oneapi/tbb/parallel_pipeline.h>
#include <oneapi/tbb/task_arena.h>

#include <atomic>
#include <memory>

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
  // TBB copies small values only.
  using Message = std::shared_ptr<InTurn>;
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
  const auto work_on = [&](std::int64_t index) -> Message {
    return is_ended ? nullptr : std::make_shared<InTurn>(work(index));
  };
  const auto take = [&](const Message& in_turn) {
    if (is_ended) return;
    if ((*in_turn)()) {
      ++taken;
    } else {
      is_ended = true;
    }
  };
  tbb::task_arena arena(threads);
  arena.execute([&] {
    tbb::parallel_pipeline(
        static_cast<std::size_t>(threads) * kResultsPerThread,
        tbb::make_filter<void, std::int64_t>(tbb::filter_mode::serial_in_order, feed) &
            tbb::make_filter<std::int64_t, Message>(tbb::filter_mode::parallel, work_on) &
            tbb::make_filter<Message, void>(tbb::filter_mode::serial_in_order, take));
  });
  return taken;
}

}  // namespace qmpipe
