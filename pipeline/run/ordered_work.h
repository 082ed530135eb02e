// Tiles worked on by several threads, and what comes of them taken in order by one at a time.
#pragma once

#include <cstdint>
#include <functional>

namespace qmpipe {

// What is to be done with a result in its turn; false ends the run.
using InTurn = std::function<bool()>;

// Calls work(0), work(1), ... work(count - 1) on so many threads, several at once, and what they
// return one after the other, in order. Few results wait at a time. It ends early when an InTurn
// says so or `should_stop` does, then every work begun is finished and taken unless an InTurn ended
// it. Returns how many were taken. An exception of either ends it too and is thrown again.
// REQUIRES: threads >= 1; `should_stop` may be called from any thread.
std::int64_t work_in_order(std::int32_t threads, std::int64_t count,
                           const std::function<InTurn(std::int64_t)>& work,
                           const std::function<bool()>& should_stop);

}  // namespace qmpipe
