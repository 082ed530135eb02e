// Hands out the tiles of a plan: a tile is ready once all it waits for have published their borders
// and there is room for it in flight.
//
// Room is a window over the schedule, not a count: a tile may start only when fewer than
// `max_in_flight` tiles stand between it and the earliest tile that is not retired. So finished
// tiles that wait for an earlier one (the sink takes them in the schedule's order) can never take
// the last room from it: the earliest unretired tile is always allowed to start, and everything it
// waits for stands before it. Hence no deadlock, whatever the timing and however small the window.
//
// Thread rule: all members are safe from any thread.
#pragma once

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <queue>
#include <vector>

#include "scheduler/wavefront.h"

namespace qmpipe {

class ReadyQueue {
 public:
  // The tiles before `first` were done by an earlier run: they count as published and retired.
  // REQUIRES: `plan` outlives the queue; max_in_flight >= 1; 0 <= first <= number of tiles.
  ReadyQueue(const WavefrontPlan& plan, std::int32_t max_in_flight, TileIndex first = 0);

  // The earliest ready tile, which is then in flight; none when nothing is ready now.
  std::optional<TileIndex> pop();
  // The tile's borders are decided: its heirs need not wait for it any longer.
  // REQUIRES: in flight, not published before.
  void publish(TileIndex tile);
  // The tile has left the program's memory. REQUIRES: published; tiles retire in schedule order.
  void retire(TileIndex tile);

  bool all_retired() const;
  std::int32_t in_flight() const;
  // Ready and not handed out: held back by the window, or nobody has asked yet.
  std::int32_t waiting_for_room() const;
  std::int32_t largest_in_flight() const;

 private:
  using MinHeap = std::priority_queue<TileIndex, std::vector<TileIndex>, std::greater<>>;

  // REQUIRES: mutex_ is held, or nobody else knows of the queue yet.
  void release_heirs(TileIndex tile);

  const WavefrontPlan& plan_;
  const std::int32_t max_in_flight_;
  mutable std::mutex mutex_;
  std::vector<std::int32_t> in_degree_;
  MinHeap ready_;
  TileIndex next_to_retire_ = 0;
  std::int32_t in_flight_ = 0;
  std::int32_t largest_in_flight_ = 0;
};

}  // namespace qmpipe
