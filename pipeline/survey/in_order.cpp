#include "pipeline/survey/in_order.h"

#include <oneapi/tbb/parallel_for.h>
#include <oneapi/tbb/task_arena.h>
#include <oneapi/tbb/task_group.h>

#include <atomic>

namespace qmpipe {

void for_each_in_order(std::int32_t threads, std::size_t count,
                       const std::function<void(std::size_t)>& body) {
  std::atomic<std::size_t> next = 0;
  const auto take = [&](std::int32_t) {
    for (std::size_t k = next++; k < count && !tbb::is_current_task_group_canceling(); k = next++) {
      body(k);
    }
  };
  tbb::task_arena arena(threads);
  arena.execute([&] { tbb::parallel_for(0, threads, take, tbb::simple_partitioner()); });
}

}  // namespace qmpipe
